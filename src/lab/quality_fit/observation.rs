//! What the law is fitted to: trained layouts and their nearest views for each pixel of the test views.

use std::collections::BTreeMap;

use crate::engine::parallel::mapped;
use crate::planner::metrics::score_point::{View, view};
use crate::planner::quality::law::FARTHEST;
use crate::planner::quality::look::{Caster, Look, Surroundings, Viewer};
use crate::planner::quality::nearest::{nearest_cameras, widest};
use crate::scene::camera::Camera;
use crate::visibility::device_scene::SceneGeometry;

/// Pixels of a test view along each side of its picture, evenly.
const SIDE: u32 = 16;
/// Test views that show the surface in fewer pixels than this are ignored.
const MIN_SHOWN: usize = 16;

/// A layout of cameras that was trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// What it is called.
    pub name: String,
    /// Its number of cameras.
    pub views: u32,
    /// Their field of view along the longer side in whole degrees, the mean.
    pub degrees: u32,
    /// Trained PSNR in decibels by test view, of those in `shown`.
    pub psnr: Vec<f64>,
    /// By look: the angles of the nearest and of the third nearest view in radians, and how much larger the nearest one's
    /// footprint is than the viewer's, as a logarithm that is not negative.
    pub near: Vec<[f32; 3]>,
}

impl Layout {
    /// Trained PSNR in decibels, the mean over the test views that show enough of the surface.
    pub fn trained(&self) -> f64 {
        self.psnr.iter().sum::<f64>() / self.psnr.len().max(1) as f64
    }
}

/// The layouts of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Observations {
    /// The scene.
    pub name: String,
    /// By look: whether it is beside the surface.
    pub beside: Vec<bool>,
    /// The test views that show enough of the surface, by their places.
    pub shown: Vec<usize>,
    /// Where the looks of each of these end.
    pub ends: Vec<usize>,
    /// What was trained.
    pub layouts: Vec<Layout>,
}

impl Observations {
    /// Casts the rays of the test views' pixels, and from there to the cameras of each run: its name, its cameras and the trained PSNR of
    /// each test view. All cameras are given in the user's world.
    pub fn new(
        name: &str,
        geometry: &SceneGeometry,
        around: Surroundings,
        tests: &[Camera],
        runs: &[(String, Vec<Camera>, Vec<f64>)],
    ) -> Self {
        let caster = Caster::new(geometry, around);
        let views = mapped(tests, |_, test| {
            let viewer = Viewer::new(test, geometry);
            let place = |pixel: u32| [pixel % SIDE, pixel / SIDE].map(|at| (at as f32 + 0.5) / SIDE as f32);
            let looks = (0..SIDE * SIDE).map(|pixel| caster.look(&viewer, place(pixel)));
            looks.filter(|look| look.distance > 0.0).collect::<Vec<Look>>()
        });
        let on_surface = |looks: &&Vec<Look>| looks.iter().filter(|look| look.normal != [0.0; 3]).count() >= MIN_SHOWN;
        let (mut looks, mut ends, mut kept) = (Vec::new(), Vec::new(), Vec::new());
        for (view, of_view) in views.iter().enumerate().filter(|(_, looks)| on_surface(looks)) {
            looks.extend_from_slice(of_view);
            ends.push(looks.len());
            kept.push(view);
        }
        let layouts = mapped(runs, |_, (name, cameras, psnr)| {
            let views: Vec<View> = cameras.iter().map(|camera| view(geometry, camera)).collect();
            let near = looks.iter().map(|look| {
                let found = nearest_cameras(&geometry.bvh, look, &views);
                let angle = |k: usize| found.get(k).map_or(FARTHEST, |near| near.cost) as f32;
                let ratio = found.first().map_or(1.0, |near| near.footprint / f64::from(look.footprint));
                [angle(0), angle(2), ratio.ln().max(0.0) as f32]
            });
            let fov: f64 = views.iter().map(|view| 2.0 * widest(view).atan().to_degrees()).sum();
            Layout {
                name: name.clone(),
                views: views.len() as u32,
                degrees: (fov / views.len().max(1) as f64).round() as u32,
                psnr: kept.iter().map(|view| psnr[*view]).collect(),
                near: near.collect(),
            }
        });
        let beside = looks.iter().map(|look| look.normal == [0.0; 3]).collect();
        Self { name: name.to_owned(), beside, shown: kept, ends, layouts }
    }

    /// The layouts by their number of views and lens, by their places.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups = BTreeMap::<(u32, u32), Vec<usize>>::new();
        for (i, layout) in self.layouts.iter().enumerate() {
            groups.entry((layout.views, layout.degrees)).or_default().push(i);
        }
        groups.into_values().collect()
    }
}
