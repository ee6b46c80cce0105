//! What the tests of Gaussian splatting share: random scenes, and one pass over them on the device.
#![allow(dead_code, reason = "each test binary uses a part")]

pub mod capture;

use std::sync::Arc;

use camsplat::Result;
use camsplat::engine::vulkan::{Buffer, Context, Recorder};
use camsplat::scene::gaussians::{Gaussians, coefficients};
use camsplat::scene::random;
use camsplat::splats::render::frame::View;
use camsplat::splats::render::layout::{self, PassPush};
use camsplat::splats::render::rasterizer::{Model, Rasterizer, Size, Sizes};
use camsplat::splats::render::wanted::Wanted;
use camsplat::splats::train::loss::{Ledger, Loss, Record};
use camsplat::splats::train::update::{Learnt, Moments, Update, UpdatePush};
use camsplat::splats::twin;
use glam::{DMat3, DVec3};

/// Uniform numbers in [-1, 1) without end.
pub struct Draws {
    seed: u64,
    next: u32,
}

impl Draws {
    /// Numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Self { seed, next: 0 }
    }

    /// The next number.
    pub fn one(&mut self) -> f64 {
        self.next += 1;
        2.0 * random::uniforms(self.seed, 77, self.next)[0] - 1.0
    }

    /// A vector of them.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.one(), self.one(), self.one())
    }
}

/// Random Gaussians about the origin, with everything that is odd: behind the camera, at the edge, larger than the picture,
/// flat as a sheet, opacities near 0 and 1, quaternions of any length.
pub fn scene(seed: u64, count: usize, degree: u32) -> Gaussians {
    let mut draw = Draws::new(seed);
    let mut gaussians = Gaussians { degree, ..Gaussians::default() };
    for i in 0..count {
        let odd = i % 16;
        let far = if odd == 0 { 8.0 } else { 1.2 };
        gaussians.centres.push((far * draw.vector()).as_vec3().as_dvec3());
        let size = match odd {
            1 => 0.5,
            2 => -6.0,
            _ => -2.5 + 0.8 * draw.one(),
        };
        let flat = if odd == 3 { -9.0 } else { 0.0 };
        gaussians.log_scales.push([size + 0.5 * draw.one(), size + 0.5 * draw.one(), size + flat].map(|v| v as f32));
        let length = 1.0 + 0.7 * draw.one();
        let q = [draw.one(), draw.one(), draw.one(), draw.one() + 0.1].map(|v| (length * v) as f32);
        gaussians.rotations.push(q);
        let opacity = match odd {
            4 => 9.0,
            5 => -5.4,
            _ => 2.0 * draw.one(),
        };
        gaussians.opacities.push(opacity as f32);
        let decay = |k: usize| if k < 3 { 1.0 } else { 0.3 };
        gaussians.harmonics.extend((0..3 * coefficients(degree)).map(|k| (decay(k) * draw.one()) as f32));
    }
    gaussians
}

/// A camera that looks at the origin from a little off the axes.
pub fn view(width: u32, height: u32) -> View {
    let position = DVec3::new(0.7, -0.4, -3.0);
    let z = (-position).normalize();
    let x = DVec3::Y.cross(z).normalize();
    let y = z.cross(x);
    let row = |axis: DVec3| axis.extend(-axis.dot(position)).as_vec4().to_array();
    View {
        row_x: row(x),
        row_y: row(y),
        row_z: row(z),
        position: position.as_vec3().to_array(),
        near: 0.05,
        focal: [1.1 * width as f32, 1.15 * width as f32],
        principal: [0.47 * width as f32, 0.53 * height as f32],
        width,
        height,
        ..View::default()
    }
}

/// The same camera for the twin.
pub fn twin_view(view: &View) -> twin::View {
    let rows = [view.row_x, view.row_y, view.row_z].map(|row| row.map(f64::from));
    let row = |i: usize| DVec3::new(rows[i][0], rows[i][1], rows[i][2]);
    twin::View {
        rotation: DMat3::from_cols(row(0), row(1), row(2)).transpose(),
        translation: DVec3::new(rows[0][3], rows[1][3], rows[2][3]),
        focal: view.focal.map(f64::from),
        principal: view.principal.map(f64::from),
        width: view.width,
        height: view.height,
        near: f64::from(view.near),
    }
}

/// The results of one pass on the device.
pub struct Pass {
    /// Colour over the background and transmittance of each pixel.
    pub picture: Vec<[f32; 4]>,
    /// Sum of depths of each pixel.
    pub depths: Vec<f32>,
    /// The loss terms of the iteration.
    pub record: Record,
    /// Gradient of the loss by each pixel.
    pub by_pixel: Vec<[f32; 4]>,
    /// Gradient of the loss by each parameter, in planes without gaps.
    pub gradients: Vec<f32>,
    /// What turning each Gaussian about the camera and moving it change, in planes.
    pub forces: Vec<f32>,
    /// Instances.
    pub instances: u32,
}

/// Renders, compares with a photo, and goes all the way back.
pub fn pass(
    context: &Arc<Context>,
    gaussians: &Gaussians,
    view: View,
    photo: &[u32],
    background: [f32; 3],
    wanted: Wanted,
    capacity: u32,
) -> Result<Pass> {
    let size = Size { width: view.width, height: view.height };
    let count = gaussians.len() as u32;
    let stride = count.max(1);
    let sizes = Sizes { gaussians: stride, capacity, pixels: size.pixels(), tiles: size.tiles() };
    let planes = layout::to_planes(gaussians, gaussians.degree, stride as usize);
    let zeros = vec![0f32; planes.len()];
    let model = Model {
        parameters: Buffer::from_slice(context, "parameters", &planes)?,
        population: Buffer::from_slice(context, "population", &[count])?,
        stride,
        planes: layout::planes(gaussians.degree) as u32,
    };
    let moments = Moments {
        first: Buffer::from_slice(context, "first", &zeros)?,
        second: Buffer::from_slice(context, "second", &zeros)?,
        statistics: Buffer::device(context, "statistics", 16)?,
        forces: Buffer::device(context, "forces", 24 * u64::from(stride))?,
    };
    let ledger = Ledger {
        control: Buffer::from_slice(context, "control", &[0u32])?,
        history: Buffer::host(context, "history", size_of::<Record>() as u64)?,
        mailbox: Buffer::host(context, "mailbox", 16)?,
    };
    let views = Buffer::from_slice(context, "views", &[view])?;
    let rasterizer = Rasterizer::new(context, sizes, wanted)?;
    let loss = Loss::new(context, &sizes, wanted.divided(context)?)?;
    loss.photo.upload(photo)?;
    let update = Update::new(context, wanted, false, Learnt::GaussiansAndPose)?;
    let push = PassPush { stride, view: 0, degree: gaussians.degree, capacity, background, iteration: 0 };
    // Rates of zero leave the parameters; Adam's first mean is then a tenth of the gradient.
    let step = UpdatePush { stride, degree: gaussians.degree, ..UpdatePush::default() };
    let mut commands = Recorder::new(context)?;
    let instances = rasterizer.forward(&mut commands, &model, &views, size, &push)?;
    loss.record(
        &mut commands,
        [&views, &rasterizer.picture, &rasterizer.counts, &model.population],
        &ledger,
        size,
        &push,
    );
    rasterizer.backward(&mut commands, &views, instances, &loss.by_pixel, &push);
    update.record(&mut commands, [&views, &ledger.control], &rasterizer, &model, &moments, &step);
    commands.submit_and_wait()?;
    let pixels = size.pixels() as usize;
    let records: Vec<Record> = ledger.history.read(1)?;
    Ok(Pass {
        picture: rasterizer.picture.download(pixels)?,
        depths: rasterizer.depths.download(pixels)?,
        record: records[0],
        by_pixel: loss.by_pixel.download(pixels)?,
        gradients: moments.first.download::<f32>(planes.len())?.into_iter().map(|m| 10.0 * m).collect(),
        forces: moments.forces.download(6 * stride as usize)?,
        instances: rasterizer.counts.download::<u32>(1)?[0],
    })
}

/// A photo of smooth noise, some of it transparent, some of it unknown.
pub fn photo(seed: u64, view: &View) -> Vec<u32> {
    let mut draw = Draws::new(seed);
    let waves: Vec<[f64; 3]> = (0..3).map(|_| draw.vector().to_array()).collect();
    (0..view.width * view.height)
        .map(|i| {
            let (x, y) = (f64::from(i % view.width) / 9.0, f64::from(i / view.width) / 7.0);
            let byte = |w: &[f64; 3]| (127.0 + 120.0 * (w[0] * x + 2.0 * w[1] * y + 6.0 * w[2]).sin()) as u32;
            let [r, g, b] = [byte(&waves[0]), byte(&waves[1]), byte(&waves[2])];
            match i % 97 {
                0 => 0x00ff_ffff,
                1..9 => r | g << 8 | b << 16 | (i % 256) << 24,
                _ => r | g << 8 | b << 16 | 255 << 24,
            }
        })
        .collect()
}
