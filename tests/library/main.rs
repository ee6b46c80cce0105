//! The library and its stages, a folder for each storey: known answers, twins, finite differences, and data of others where there is any.

mod app {
    mod report_page;
    mod report_scene;
    mod training_report;
}

mod engine {
    mod between_frames;
    mod draw;
    mod embed;
    mod primitives_arithmetic;
    mod primitives_copy;
    mod primitives_key_ranges;
    mod primitives_radix_sort;
    mod primitives_reduce;
    mod primitives_scan;
    mod recorder;
}

mod files {
    mod assimp;
    mod captures;
    mod data;
    mod pycolmap_models;
}

mod lab {
    mod lightmap;
    mod manifold;
    mod path_tracer;
    mod path_tracer_data;
    mod vdsf;
}

mod photogrammetry {
    mod vds;
}

mod planner {
    mod expected_quality;
    mod links;
    mod metrics;
    mod plans;
    mod relocation;
    mod retrained;
    mod select;
    mod steps;
}

mod scene {
    mod preparation;
}

mod splats {
    mod data;
    mod exposures;
    mod fisher;
    mod image_metrics;
    mod passes;
    mod poses;
    mod training;
}

mod visibility {
    mod probes;
}

#[path = "../support"]
mod support {
    pub mod browser;
    pub mod buffers;
    pub mod data;
    pub mod device;
    pub mod host;
    pub mod images;
    pub mod lpips_weights;
    pub mod photographs;
    pub mod plans;
    pub mod splats;
}
