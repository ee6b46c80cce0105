//! The built program as users meet it: what each command leaves, refuses and repeats.

mod baselines_command;
mod capture;
mod capture_command;
mod cli;
mod cli_options;
mod cli_refusals;
mod convert;
mod demo;
mod depth_maps;
mod determinism;
mod evaluate_command;
mod evaluate_kinds;
mod evaluate_layouts;
mod evaluate_situations;
mod export_command;
mod frames;
mod keep_out_areas;
mod known_space;
mod limits;
mod metrics_command;
mod missions;
mod next;
mod quality_fit;
mod real_captures;
mod render;
mod select_command;
mod shots;
mod stereo;
mod tour;
mod train_command;
mod train_refusals;
mod train_stops;
mod vds_command;
mod view_command;
mod watch;

#[path = "../support"]
mod support {
    pub mod ball_scene;
    pub mod browser;
    pub mod command;
    pub mod data;
    pub mod device;
    pub mod gps;
    pub mod images;
    pub mod lpips_weights;
    pub mod splats;
}
