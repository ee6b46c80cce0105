//! The library and its stages: known answers, twins, finite differences, and data of others where there is any.

mod between_frames;
mod captures;
mod draw;
mod embed;
mod expected_quality;
mod gaussian_data;
mod gaussian_fisher;
mod gaussian_passes;
mod image_metrics;
mod io_data;
mod lightmap;
mod links;
mod manifold;
mod metrics;
mod photograph;
mod photograph_data;
mod planner;
mod primitives_arithmetic;
mod primitives_copy;
mod primitives_radix_sort;
mod primitives_reduce;
mod primitives_scan;
mod recorder;
mod relocation;
mod report_page;
mod report_scene;
mod retrained;
mod scene_preparation;
mod select;
mod steps;
mod training;
mod training_report;
mod vds;
mod vdsf;
mod visibility;

#[path = "../support"]
mod support {
    pub mod browser;
    pub mod buffers;
    pub mod host;
    pub mod images;
    pub mod lpips_weights;
    pub mod photographs;
    pub mod plans;
    pub mod splats;
}
