//! What a run is read back as and taken up from, and the pictures of its test views.

use super::density;
use super::exposure::{ExposureState, Exposures};
use super::loss::Record;
use super::poses::{PoseState, Poses};
use super::test_poses::Parts;
use super::trainer::Trainer;
use crate::engine::vulkan::Buffer;
use crate::scene::gaussians::Gaussians;
use crate::splats::config::Strategy;
use crate::splats::exposure::Exposure;
use crate::splats::pose::PoseCorrection;
use crate::splats::render::frame::View;
use crate::splats::render::layout::{self, PassPush};
use crate::splats::render::rasterizer::Size;
use crate::{Error, Result};

/// All that a run carries from one iteration to the next, on the host.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Iterations done.
    pub done: u32,
    /// Gaussians that there are.
    pub population: u32,
    /// Parameters, and Adam's two means: planes, `population` apart.
    pub planes: [Vec<f32>; 3],
    /// Sum of lengths of gradients and number of views of each Gaussian; empty where nothing is decided by them.
    pub statistics: Vec<[f32; 2]>,
    /// Of the photos, where they are learnt.
    pub exposures: Vec<ExposureState>,
    /// Of the photos, where they are learnt.
    pub poses: Vec<PoseState>,
}

impl Trainer {
    /// Resumes a run where it was stopped: the trainer must have been made of the same configuration, start and photos.
    ///
    /// # Errors
    /// Where there are more Gaussians than the budget, or the device fails.
    pub fn restore(&mut self, state: &State, history: &[Record]) -> Result<()> {
        let (population, stride) = (state.population as usize, self.model.stride as usize);
        if population > stride || state.planes.iter().any(|plane| plane.len() != self.planes() * population) {
            return Err(Error::request("a state of another size cannot be taken up"));
        }
        let buffers = [&self.model.parameters, &self.moments.first, &self.moments.second];
        for (buffer, packed) in buffers.into_iter().zip(&state.planes) {
            let mut values = vec![0f32; self.planes() * stride];
            for (to, from) in values.chunks_mut(stride).zip(packed.chunks(population.max(1))) {
                to[..from.len()].copy_from_slice(from);
            }
            buffer.upload(&values)?;
        }
        self.model.population.upload(&[state.population])?;
        self.ledger.history.write(history)?;
        self.moments.statistics.upload(&state.statistics)?;
        if let Some(exposures) = &self.exposures {
            exposures.restore(&state.exposures)?;
        }
        if let Some(poses) = &self.poses {
            poses.restore(&self.context, &state.poses, &self.view_buffer)?;
        }
        self.ledger.mailbox.write(&[state.done, 0, 0, 0])?;
        self.done = state.done;
        Ok(())
    }

    /// What the model looks like from a view, over the background that tests are shown over.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory.
    pub fn picture(&mut self, view: usize) -> Result<Vec<[f32; 4]>> {
        let (size, push) = self.test_pass(view);
        self.rasterizer.render(&self.model, &self.view_buffer, size, push)?;
        self.rasterizer.picture.download(size.pixels() as usize)
    }

    /// The same of the view of a photo that nobody trains on, in 8 bits as [`crate::splats::data::pictures`] has it: where poses are corrected,
    /// so is that of this view, for its picture alone.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory.
    pub fn picture_like(&mut self, view: usize, photo: &[u32]) -> Result<Vec<[f32; 4]>> {
        let (size, push) = self.test_pass(view);
        let Some(tests) = &self.test_poses else { return self.picture(view) };
        let parts =
            Parts { model: &self.model, rasterizer: &mut self.rasterizer, loss: &self.loss, moments: &self.moments };
        let mut pace = self.pace.clone();
        let found = tests.find(parts, self.views[view], photo, push, &mut pace)?;
        self.pace = pace;
        self.rasterizer.render(&self.model, found, size, PassPush { view: 0, ..push })?;
        self.rasterizer.picture.download(size.pixels() as usize)
    }

    /// The size of a view's picture, and how it is made.
    fn test_pass(&self, view: usize) -> (Size, PassPush) {
        let View { width, height, .. } = self.views[view];
        let push = PassPush {
            stride: self.model.stride,
            view: view as u32,
            degree: self.degree(),
            background: self.config.test_background(),
            ..PassPush::default()
        };
        (Size { width, height }, push)
    }

    /// Reads back all that the next iteration needs.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn state(&self) -> Result<State> {
        let population = self.model.population.download::<u32>(1)?[0];
        let packed = |buffer: &Buffer| self.packed(buffer, population);
        let planes = [packed(&self.model.parameters)?, packed(&self.moments.first)?, packed(&self.moments.second)?];
        let counted = if self.config.strategy == Strategy::Adc { population as usize } else { 0 };
        let statistics = self.moments.statistics.download(counted)?;
        let exposures = self.exposures.as_ref().map_or(Ok(Vec::new()), Exposures::states)?;
        let poses = self.poses.as_ref().map_or(Ok(Vec::new()), Poses::states)?;
        Ok(State { done: self.done, population, planes, statistics, exposures, poses })
    }

    /// Exposures of the photos as they are; empty where none are learnt.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn exposures(&self) -> Result<Vec<Exposure>> {
        self.exposures.as_ref().map_or(Ok(Vec::new()), Exposures::learnt)
    }

    /// Corrections of the photos' poses as they are; empty where none are learnt.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn poses(&self) -> Result<Vec<PoseCorrection>> {
        self.poses.as_ref().map_or(Ok(Vec::new()), Poses::learnt)
    }

    /// The values of the first `population` Gaussians, plane by plane.
    fn packed(&self, buffer: &Buffer, population: u32) -> Result<Vec<f32>> {
        let (population, stride) = (population as usize, self.model.stride as usize);
        let mut values = Vec::with_capacity(self.planes() * population);
        for plane in 0..self.planes() {
            values.extend(buffer.download_from::<f32>(plane * stride, population)?);
        }
        Ok(values)
    }

    /// The Gaussians as they are, in the training frame.
    ///
    /// # Errors
    /// Where the device fails.
    pub fn gaussians(&self) -> Result<Gaussians> {
        let population = self.model.population.download::<u32>(1)?[0];
        let parameters = self.packed(&self.model.parameters, population)?;
        let all = layout::from_planes(&parameters, self.config.degree, population as usize, population as usize);
        // Free slots and NaN are never drawn.
        Ok(all.filtered(|i| all.opacities[i] >= 0.5 * density::FREE && all.is_finite(i)))
    }
}
