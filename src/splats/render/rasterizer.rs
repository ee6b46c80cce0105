//! From Gaussians to a picture and back: projection, tiles, sort, compositing (`splat_project.comp` to
//! `splat_forward.comp`), and the gradient by what each Gaussian brings to each tile (`splat_backward.comp`).

use std::sync::Arc;

use super::frame::View;
use super::layout::{BLOCK, PassPush, Projected, SUMS, SplatConstants, TILE, TileConstants, planes};
use super::wanted::Wanted;
use crate::engine::primitives::{Count, KeyRanges, RadixSort, Scan};
use crate::engine::vulkan::{Buffer, Context, Pipeline, Recorder, footprint};
use crate::{Error, Result};

crate::stage!(
    /// Every Gaussian as a view sees it.
    pub(crate) SplatProjectStage = splat_project<SplatConstants>(PassPush) {
        read views, read population, read parameters, write projected, write depth_keys, write depth_splats,
    } with [View, Projected]
);
crate::stage!(
    /// Tiles of each Gaussian, in the order of depth.
    pub(crate) SplatCountStage = splat_count(PassPush) {
        read views, read population, read projected, read depth_splats, write tile_counts,
    } with [View, Projected]
);
crate::stage!(
    /// An instance per tile of each Gaussian.
    pub(crate) SplatEmitStage = splat_emit(PassPush) {
        read views, read population, read projected, read depth_splats, read tile_counts, read tile_offsets,
        write tile_keys, write tile_instances, write instance_splats, write runs,
    } with [View, Projected]
);
crate::stage!(
    /// Compositing, a workgroup per tile.
    pub(crate) SplatForwardStage = splat_forward<TileConstants>(PassPush) {
        read views, read projected, read instance_splats, read tile_instances, read ranges, write picture, write ends,
        write tile_ends, write checkpoints, write depths,
    } with [View, Projected]
);
crate::stage!(
    /// Sums over pixels, a workgroup per block of instances.
    pub(crate) SplatBackwardStage = splat_backward<TileConstants>(PassPush) {
        read views, read projected, read counts, read instance_splats, read tile_keys, read tile_instances, read ranges,
        read picture, read ends, read tile_ends, read checkpoints, read by_pixel, write partials,
    } with [View, Projected]
);

crate::stage!(
    /// The same, summed into the Gaussians at once by atomic additions of floats.
    pub(crate) SplatBackwardFastStage = splat_backward_fast<TileConstants>(PassPush) {
        read views, read projected, read counts, read instance_splats, read tile_keys, read tile_instances, read ranges,
        read picture, read ends, read tile_ends, read checkpoints, read by_pixel, write partials,
    } with [View, Projected]
);

/// Pixels of a picture along a side at most.
pub(crate) const MAX_SIDE: u32 = 65_535;

/// How large pictures and models can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Most Gaussians.
    pub gaussians: u32,
    /// Instances: pairs of a Gaussian and a tile that it reaches.
    pub capacity: u32,
    /// Pixels of a picture.
    pub pixels: u32,
    /// Tiles of a picture.
    pub tiles: u32,
}

/// Gaussians on the device.
pub struct Model {
    /// Planes of values, see [`super::layout`].
    pub parameters: Buffer,
    /// One word: how many there are.
    pub population: Buffer,
    /// From one plane to the next.
    pub stride: u32,
    /// Planes of parameters, a value per Gaussian each.
    pub planes: u32,
}

impl Model {
    /// Of `most` Gaussians with harmonics of that degree; the buffers hold anything.
    ///
    /// # Errors
    /// Where the device has too little memory.
    pub fn new(context: &Arc<Context>, most: u32, degree: u32) -> Result<Self> {
        let planes = planes(degree) as u32;
        let bytes = 4 * u64::from(planes) * u64::from(most);
        let parameters = Buffer::device(context, "parameters", bytes)?;
        Ok(Self { parameters, population: Buffer::device(context, "population", 4)?, stride: most, planes })
    }
}

/// Instances in the order of their tiles, as the forward pass left them.
#[derive(Clone, Copy)]
pub struct Instances<'a> {
    keys: &'a Buffer,
    values: &'a Buffer,
}

/// Size of a picture to be made; the rest of the view is on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl Size {
    /// Tiles that cover the picture.
    pub fn tiles(self) -> u32 {
        self.width.div_ceil(TILE) * self.height.div_ceil(TILE)
    }

    /// Pixels: width times height.
    pub fn pixels(self) -> u32 {
        self.width * self.height
    }
}

/// Pipelines and buffers.
pub struct Rasterizer {
    project: Pipeline,
    count: Pipeline,
    emit: Pipeline,
    forward: Pipeline,
    backward: Pipeline,
    scan: Scan,
    context: Arc<Context>,
    wanted: Wanted,
    sizes: Sizes,
    depth_keys: Buffer,
    depth_splats: Buffer,
    tile_counts: Buffer,
    tile_offsets: Buffer,
    tile_ranges: Buffer,
    ends: Buffer,
    tile_ends: Buffer,
    lists: Lists,
    /// Every Gaussian as the view sees it.
    pub projected: Buffer,
    /// First instance and number of instances of each Gaussian.
    pub runs: Buffer,
    /// One word: the instances of the picture, also where there was capacity for fewer.
    pub counts: Buffer,
    /// Colour over the background and the light that is left, per pixel.
    pub picture: Buffer,
    /// Sums of depths per pixel, where they are requested.
    pub depths: Buffer,
}

/// What grows with the instances.
struct Lists {
    tile_keys: Buffer,
    tile_instances: Buffer,
    instance_splats: Buffer,
    checkpoints: Buffer,
    /// Sums of each instance in the order of emission, or of each Gaussian in the fast way, where gradients are requested.
    partials: Buffer,
    sort: RadixSort,
    ranges: KeyRanges,
}

impl Lists {
    fn new(context: &Arc<Context>, sizes: &Sizes, wanted: Wanted) -> Result<Self> {
        let plan = buffers(context, sizes, wanted);
        let buffer = |name: &str| footprint::buffer(context, &plan, name);
        Ok(Self {
            tile_keys: buffer("tile_keys")?,
            tile_instances: buffer("tile_instances")?,
            instance_splats: buffer("instance_splats")?,
            checkpoints: buffer("checkpoints")?,
            partials: buffer("partials")?,
            sort: RadixSort::new(context, sizes.gaussians.max(sizes.capacity))?,
            ranges: KeyRanges::new(context, sizes.capacity)?,
        })
    }
}

/// Buffers by name and bytes.
pub fn buffers(context: &Context, sizes: &Sizes, wanted: Wanted) -> Vec<(&'static str, u64)> {
    let [gaussians, capacity, pixels, tiles] =
        [sizes.gaussians, sizes.capacity, sizes.pixels, sizes.tiles].map(u64::from);
    let checkpoints = 16 * u64::from(TILE * TILE) * (capacity / u64::from(BLOCK) + 1);
    let only = |there: bool, bytes: u64| if there { bytes } else { 0 };
    vec![
        ("projected", size_of::<Projected>() as u64 * gaussians),
        ("depth_keys", 4 * gaussians),
        ("depth_splats", 4 * gaussians),
        ("tile_counts", 4 * gaussians),
        ("tile_offsets", 4 * gaussians),
        ("runs", 8 * gaussians),
        ("counts", 4),
        ("tile_keys", 4 * capacity),
        ("tile_instances", 4 * capacity),
        ("instance_splats", 4 * capacity),
        ("ranges", 8 * tiles),
        ("picture", 16 * pixels),
        ("ends", 4 * pixels),
        ("tile_ends", 4 * tiles),
        // The forward pass writes them in any case.
        ("checkpoints", checkpoints),
        ("depths", only(wanted.depths, 4 * pixels)),
        ("partials", only(wanted.gradients, 4 * SUMS * if wanted.fast { gaussians } else { capacity })),
        ("sort", RadixSort::footprint(context, sizes.gaussians.max(sizes.capacity))),
        ("scan", Scan::footprint(sizes.gaussians)),
    ]
}

/// What the forward pass leaves for the way back, named as [`SplatBackwardStage`] does.
pub(crate) struct Composited<'a> {
    pub counts: &'a Buffer,
    pub instance_splats: &'a Buffer,
    pub tile_keys: &'a Buffer,
    pub tile_instances: &'a Buffer,
    pub ranges: &'a Buffer,
    pub picture: &'a Buffer,
    pub ends: &'a Buffer,
    pub tile_ends: &'a Buffer,
    pub checkpoints: &'a Buffer,
}

impl Rasterizer {
    /// Allocates for `sizes`.
    ///
    /// # Errors
    /// Where the device has too little memory, or fails.
    pub fn new(context: &Arc<Context>, sizes: Sizes, wanted: Wanted) -> Result<Self> {
        let plan = buffers(context, &sizes, wanted);
        let buffer = |name: &str| footprint::buffer(context, &plan, name);
        let threads = wanted.divided(context)?;
        if wanted.fast && !context.physical().atomic_floats {
            let name = &context.physical().name;
            return Err(Error::request(format!("{name} adds no floats atomically; train without `fast`")));
        }
        let Wanted { antialiased, depths, .. } = wanted;
        let constants = SplatConstants { antialiased };
        let lanes = threads.lanes;
        let subgroups = context.physical().subgroup_width == Some(lanes);
        let tiled = |local_size_x| TileConstants { antialiased, local_size_x, depths, lanes, subgroups };
        let backward =
            if wanted.fast { Pipeline::new::<SplatBackwardFastStage> } else { Pipeline::new::<SplatBackwardStage> };
        Ok(Self {
            project: Pipeline::new::<SplatProjectStage>(context, &constants)?,
            count: Pipeline::new::<SplatCountStage>(context, &())?,
            emit: Pipeline::new::<SplatEmitStage>(context, &())?,
            forward: Pipeline::new::<SplatForwardStage>(context, &tiled(threads.forward))?,
            backward: backward(context, &tiled(lanes))?,
            scan: Scan::new(context, sizes.gaussians)?,
            context: context.clone(),
            wanted,
            lists: Lists::new(context, &sizes, wanted)?,
            sizes,
            depth_keys: buffer("depth_keys")?,
            depth_splats: buffer("depth_splats")?,
            tile_counts: buffer("tile_counts")?,
            tile_offsets: buffer("tile_offsets")?,
            tile_ranges: buffer("ranges")?,
            ends: buffer("ends")?,
            tile_ends: buffer("tile_ends")?,
            projected: buffer("projected")?,
            runs: buffer("runs")?,
            counts: buffer("counts")?,
            picture: buffer("picture")?,
            depths: buffer("depths")?,
        })
    }

    /// Words for each Gaussian, two in the last, that nothing needs between two pictures; and the scan over them.
    pub fn scratch(&self) -> ([&Buffer; 5], &Scan) {
        let words = [&self.depth_keys, &self.depth_splats, &self.tile_counts, &self.tile_offsets, &self.runs];
        (words, &self.scan)
    }

    /// What an instance or a Gaussian is summed into, see [`SplatBackwardStage`].
    pub fn partials(&self) -> &Buffer {
        &self.lists.partials
    }

    /// What the forward pass left, for stages of others.
    pub(crate) fn composited<'a>(&'a self, instances: Instances<'a>) -> Composited<'a> {
        Composited {
            counts: &self.counts,
            instance_splats: &self.lists.instance_splats,
            tile_keys: instances.keys,
            tile_instances: instances.values,
            ranges: &self.tile_ranges,
            picture: &self.picture,
            ends: &self.ends,
            tile_ends: &self.tile_ends,
            checkpoints: &self.lists.checkpoints,
        }
    }

    /// Allocates for so many instances, in place of the old lists.
    ///
    /// # Errors
    /// Where the device has too little memory; the capacity is one instance then.
    pub fn set_capacity(&mut self, capacity: u32) -> Result<()> {
        // The old lists go first: both may not fit.
        for capacity in [1, capacity] {
            let sizes = Sizes { capacity, ..self.sizes };
            self.lists = Lists::new(&self.context, &sizes, self.wanted)?;
            self.sizes = sizes;
        }
        Ok(())
    }

    /// Allocates for so many instances and an eighth more, or else for few more.
    ///
    /// # Errors
    /// Where the device has not even memory for those, or none of its lists can be so long.
    pub fn ensure_capacity(&mut self, needed: u32) -> Result<()> {
        let physical = self.context.physical();
        let longest = physical.storage_range.min(physical.allocation) / (4 * SUMS);
        let most = u32::try_from(longest).unwrap_or(u32::MAX).min(1 << 28);
        if needed > most {
            return Err(Error::OutOfMemory {
                what: "the list of tiles that splats reach".into(),
                wanted: 4 * SUMS * u64::from(needed),
                available: 4 * SUMS * u64::from(most),
                remedy: "take fewer splats or smaller pictures".into(),
            });
        }
        let [ample, scarce] = [8, 32].map(|part| needed.saturating_add(needed / part).min(most));
        match self.set_capacity(ample) {
            Err(Error::OutOfMemory { .. }) => self.set_capacity(scarce),
            made => made,
        }
    }

    /// The capacity.
    pub fn sizes(&self) -> &Sizes {
        &self.sizes
    }

    /// Records the way from the model to the picture of view `push.view`, which is of size `size`. Where `counts` then exceeds
    /// `push.capacity`, instances are missing and the picture is wrong.
    ///
    /// # Errors
    /// None that the sizes do not rule out.
    pub fn forward<'a>(
        &'a self,
        commands: &mut Recorder,
        model: &'a Model,
        views: &'a Buffer,
        size: Size,
        push: &PassPush,
    ) -> Result<Instances<'a>> {
        let gaussians = self.sizes.gaussians;
        let population = || Count::Device(&model.population, 0);
        let by_gaussian = gaussians.div_ceil(64);
        commands
            .stage(
                &self.project,
                SplatProjectStage {
                    views,
                    population: &model.population,
                    parameters: &model.parameters,
                    projected: &self.projected,
                    depth_keys: &self.depth_keys,
                    depth_splats: &self.depth_splats,
                },
            )
            .push(push)
            .linear(by_gaussian);
        let by_depth = self.lists.sort.pairs(commands, &self.depth_keys, &self.depth_splats, population(), 31)?;
        commands
            .stage(
                &self.count,
                SplatCountStage {
                    views,
                    population: &model.population,
                    projected: &self.projected,
                    depth_splats: by_depth.values,
                    tile_counts: &self.tile_counts,
                },
            )
            .push(push)
            .linear(by_gaussian);
        self.scan.record(commands, &self.tile_counts, &self.tile_offsets, population(), (&self.counts, 0))?;
        commands
            .stage(
                &self.emit,
                SplatEmitStage {
                    views,
                    population: &model.population,
                    projected: &self.projected,
                    depth_splats: by_depth.values,
                    tile_counts: &self.tile_counts,
                    tile_offsets: &self.tile_offsets,
                    tile_keys: &self.lists.tile_keys,
                    tile_instances: &self.lists.tile_instances,
                    instance_splats: &self.lists.instance_splats,
                    runs: &self.runs,
                },
            )
            .push(push)
            .linear(by_gaussian);
        let bits = (32 - (size.tiles() - 1).leading_zeros()).max(1);
        let instances = Count::Device(&self.counts, 0);
        let by_tile =
            self.lists.sort.pairs(commands, &self.lists.tile_keys, &self.lists.tile_instances, instances, bits)?;
        self.lists.ranges.record(commands, by_tile.keys, instances, &self.tile_ranges)?;
        commands
            .stage(
                &self.forward,
                SplatForwardStage {
                    views,
                    projected: &self.projected,
                    instance_splats: &self.lists.instance_splats,
                    tile_instances: by_tile.values,
                    ranges: &self.tile_ranges,
                    picture: &self.picture,
                    ends: &self.ends,
                    tile_ends: &self.tile_ends,
                    checkpoints: &self.lists.checkpoints,
                    depths: &self.depths,
                },
            )
            .push(push)
            .linear(size.tiles());
        Ok(Instances { keys: by_tile.keys, values: by_tile.values })
    }

    /// Makes the picture of view `push.view` in [`Rasterizer::picture`] and waits for it; it allocates as needed, and `push.capacity`
    /// is ignored.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory.
    pub fn render(&mut self, model: &Model, views: &Buffer, size: Size, push: PassPush) -> Result<()> {
        loop {
            let push = PassPush { capacity: self.sizes.capacity, ..push };
            let mut commands = Recorder::new(&self.context)?;
            self.forward(&mut commands, model, views, size, &push)?;
            commands.submit_and_wait()?;
            drop(commands);
            match self.counts.download::<u32>(1)?[0] {
                needed if needed > push.capacity => self.ensure_capacity(needed)?,
                _ => return Ok(()),
            }
        }
    }

    /// Records the way back: from the gradient of the loss by each pixel (`by_pixel`, a vec4 each) to `partials`.
    pub fn backward<'a>(
        &'a self,
        commands: &mut Recorder,
        views: &'a Buffer,
        instances: Instances<'a>,
        by_pixel: &'a Buffer,
        push: &PassPush,
    ) {
        if self.wanted.fast {
            commands.fill(&self.lists.partials, 0);
        }
        commands
            .stage(
                &self.backward,
                SplatBackwardStage {
                    views,
                    projected: &self.projected,
                    counts: &self.counts,
                    instance_splats: &self.lists.instance_splats,
                    tile_keys: instances.keys,
                    tile_instances: instances.values,
                    ranges: &self.tile_ranges,
                    picture: &self.picture,
                    ends: &self.ends,
                    tile_ends: &self.tile_ends,
                    checkpoints: &self.lists.checkpoints,
                    by_pixel,
                    partials: &self.lists.partials,
                },
            )
            .push(push)
            .linear(self.sizes.capacity.div_ceil(BLOCK));
    }
}
