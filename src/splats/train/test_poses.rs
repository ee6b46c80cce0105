//! The pose of a photo that nobody trains on, found while the Gaussians stay as they are: where its picture is compared from.

use std::sync::Arc;

use super::exposure::{self, ExposureState, Exposures};
use super::loss::{Ledger, Loss, Record, mailbox};
use super::poses::{self, Poses};
use super::update::{Learnt, Moments, Update, UpdatePush};
use crate::engine::vulkan::pace::{Pace, in_parts};
use crate::engine::vulkan::{Buffer, Context};
use crate::splats::config::TrainConfig;
use crate::splats::render::frame::View;
use crate::splats::render::layout::PassPush;
use crate::splats::render::rasterizer::{Model, Rasterizer, Size, Sizes};
use crate::splats::render::wanted::Wanted;
use crate::{Error, Result};

/// Steps that a pose takes.
const STEPS: u32 = 100;

/// Pipelines and buffers.
pub(super) struct TestPoses {
    context: Arc<Context>,
    update: Update,
    poses: Poses,
    /// Where they are learnt, the photo's own: its pose must not make up for it.
    exposures: Option<Exposures>,
    /// The view that is moved.
    view: Buffer,
    ledger: Ledger,
}

/// What a picture is made of and compared with.
pub(super) struct Parts<'a> {
    pub model: &'a Model,
    pub rasterizer: &'a mut Rasterizer,
    pub loss: &'a Loss,
    /// Left as they are.
    pub moments: &'a Moments,
}

/// Buffers by name and bytes.
pub(super) fn buffers(sizes: &Sizes, config: &TrainConfig) -> Vec<(&'static str, u64)> {
    let exposures = if config.exposure { exposure::buffers(sizes, 1) } else { Vec::new() };
    let of_one = poses::buffers(sizes, 1).into_iter().chain(exposures).map(|(_, bytes)| bytes).sum::<u64>();
    vec![("test poses", of_one + size_of::<View>() as u64 + size_of::<Record>() as u64 * u64::from(STEPS))]
}

impl TestPoses {
    /// For pictures of these sizes.
    ///
    /// # Errors
    /// Where the device has too little memory, or fails.
    pub fn new(context: &Arc<Context>, sizes: &Sizes, wanted: Wanted, config: &TrainConfig) -> Result<Self> {
        let exposures = config.exposure.then(|| Exposures::new(context, sizes, 1, 0, STEPS));
        Ok(Self {
            context: context.clone(),
            update: Update::new(context, wanted, false, Learnt::Pose)?,
            poses: Poses::new(context, sizes, &[View::default()], 0)?,
            exposures: exposures.transpose()?,
            view: Buffer::from_slice(context, "test view", &[View::default()])?,
            ledger: Ledger::new(context, STEPS)?,
        })
    }

    /// The view after [`STEPS`] steps from the one that is given toward where the model looks like a photo, which is in 8 bits as
    /// [`crate::splats::data::pictures`] has it. `push` has degree and background.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory.
    pub fn find(&self, parts: Parts, given: View, photo: &[u32], push: PassPush, pace: &mut Pace) -> Result<&Buffer> {
        let Parts { model, rasterizer, loss, moments } = parts;
        loss.photo.upload(photo)?;
        while !self.attempt(Parts { model, rasterizer, loss, moments }, given, push, pace)? {
            let needed = self.ledger.mailbox.peek(mailbox::NEEDED).unwrap_or(0);
            rasterizer.ensure_capacity(needed)?;
        }
        Ok(&self.view)
    }

    /// One run of [`TestPoses::find`]; whether there was capacity for the instances.
    fn attempt(&self, parts: Parts, given: View, push: PassPush, pace: &mut Pace) -> Result<bool> {
        let Parts { model, rasterizer, loss, moments } = parts;
        let size = Size { width: given.width, height: given.height };
        self.view.upload(&[given])?;
        self.poses.begin(&[given])?;
        if let Some(exposures) = &self.exposures {
            exposures.restore(&[ExposureState::default()])?;
        }
        self.ledger.mailbox.write(&[0u32; 4])?;
        self.ledger.control.upload(&[0u32])?;
        // Once there is no capacity, or a loss is no number, further steps change nothing.
        in_parts(&self.context, pace, [STEPS, 1], |commands, steps| {
            for iteration in steps {
                let push = PassPush { view: 0, iteration, capacity: rasterizer.sizes().capacity, ..push };
                let instances = rasterizer.forward(commands, model, &self.view, size, &push)?;
                if let Some(exposures) = &self.exposures {
                    exposures.record_apply(commands, [&self.view, &rasterizer.picture], size, &push);
                }
                let pictures = [&self.view, &rasterizer.picture, &rasterizer.counts, &model.population];
                loss.record(commands, pictures, &self.ledger, size, &push);
                if let Some(exposures) = &self.exposures {
                    let buffers = [&self.view, &rasterizer.picture, &loss.by_pixel, &self.ledger.control];
                    exposures.record_step(commands, buffers, size, &push);
                }
                rasterizer.backward(commands, &self.view, instances, &loss.by_pixel, &push);
                let step = UpdatePush { stride: push.stride, degree: push.degree, ..UpdatePush::default() };
                let control = &self.ledger.control;
                self.update.record(commands, [&self.view, control], rasterizer, model, moments, &step);
                let rate = Poses::rate(f64::from(iteration) / f64::from(STEPS));
                self.poses.record_step(commands, model, [&self.view, control, &moments.forces], (0, rate));
            }
            Ok(())
        })?;
        let [needed, broken] =
            [mailbox::NEEDED, mailbox::BROKEN].map(|word| self.ledger.mailbox.peek(word).unwrap_or(0));
        if broken != 0 {
            return Err(Error::request("a test photo's loss is no number; the photo may be damaged"));
        }
        Ok(needed == 0)
    }
}
