//! The outputs of a scene that is photographed, each made once: photographs, the surface that methods are shown, choices,
//! trained splats.
//!
//! Every artifact ends with [`Error::Interrupted`] where `observe` stopped it. What is finished stays, and the next run continues
//! from there.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use serde_json::{Value, json};

use super::artifact::{Artifact, ArtifactEvent, Observe};
use super::kind::Kind;
use super::request::EvaluationRequest;
use super::scene::{Around, Scene};
use super::settings::{EvaluationSettings, Shown, Space};
use super::training::{self, Training};
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::photos::{self, Images, ReadOptions};
use crate::files::photos::{Photo, PhotoSet};
use crate::lab::path_tracer;
use crate::lab::path_tracer::lightmap::{self, Light, LightMap};
use crate::lab::path_tracer::outputs::{Outputs, Record, named, noise_of};
use crate::lab::path_tracer::tracer::Tracer;
use crate::photogrammetry::stereo;
use crate::photogrammetry::vds;
use crate::planner::plan::target::{RegionChoice, Target};
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::limits::Limits;
use crate::scene::proxy::Orientation;
use crate::scene::region::Region;
use crate::scene::surface::{Points, Surface};
use crate::splats::config::{Start, Strategy, TrainConfig};
use crate::splats::data::split::{Split, Test};
use crate::splats::run::record::TrainRecord;
use crate::{Error, Result};

/// Seed of the photographs' noise, of the surface and of its scores: these are the same in all runs.
const SEED: u64 = 1;
/// Points of the scene's own mesh that are scored, where that is what methods are shown.
const SCORED: usize = 20_000;
/// Files of the outputs.
pub(super) const SURFACE: &str = "surface.ply";

/// Photographs that what is trained is compared with.
pub struct Tests {
    artifact: Artifact,
    /// Names of those that are of one colour.
    plain: HashSet<String>,
}

impl Tests {
    /// Decibels that a perfect model would have, for the noise of the photographs; none where it is not known.
    pub fn ceiling(&self) -> Option<f64> {
        noise_of(self.artifact.folder()).psnr()
    }
}

/// What methods are given to choose by.
#[derive(Clone, Copy)]
pub(crate) struct MethodInputs<'a> {
    /// Photographs of the scene.
    pub inputs: &'a Artifact,
    /// The surface that is shown to them.
    pub shown: &'a Artifact,
}

/// A scene with its outputs.
pub(crate) struct SceneArtifacts<'a> {
    pub(super) context: Arc<Context>,
    pub(super) root: PathBuf,
    pub(super) kind: Kind,
    pub(super) settings: EvaluationSettings,
    pub(super) viewers: Viewers,
    /// How the light map was baked; none where light is traced.
    light: Option<lightmap::LightmapSettings>,
    pub(super) tracer: Tracer,
    pub(super) scene: &'a Scene,
}

impl<'a> SceneArtifacts<'a> {
    /// Uploads a scene, whose outputs lie below `root`, with its light map where photographs have one: it is the first output.
    ///
    /// # Errors
    /// Where the device has too little memory for it, or the light map was not finished.
    pub fn new(
        context: &Arc<Context>,
        root: &Path,
        request: &EvaluationRequest,
        scene: &'a Scene,
        observe: Observe,
    ) -> Result<Self> {
        let EvaluationRequest { kind, settings, .. } = *request;
        let pixels = u64::from(settings.size).pow(2);
        let light =
            (settings.light == Light::Baked).then(|| lightmap::LightmapSettings::new(pixels, settings.samples, SEED));
        let tracer = match &light {
            None => Tracer::new(context, scene.assembly.clone(), pixels)?,
            Some(light) => {
                let eyes = scene.eyes(&settings.intrinsics())?;
                let map = light_map(context, root, scene, light, &eyes, observe)?;
                Tracer::lit(context, &scene.assembly, pixels, &map)?
            }
        };
        Ok(Self {
            context: context.clone(),
            root: root.to_owned(),
            kind,
            settings,
            viewers: request.viewers.clone(),
            light,
            tracer,
            scene,
        })
    }

    /// The cameras as they are photographed: in a room, those that a method put inside an object which it did not see are moved
    /// beside it.
    pub fn settled(&self, cameras: &[Camera], observe: Observe) -> Vec<Camera> {
        let Around::Room(space) = &self.scene.views else { return cameras.to_vec() };
        let (settled, moved) = space.settled(cameras);
        if moved > 0 {
            let all = cameras.len();
            let note = format!(
                "{moved} of {all} cameras stood outside of the region or its limits, nearer to things than the clearance or in them, and \
                 have moved to the nearest free place"
            );
            let _ = observe(ArtifactEvent::Note(note));
        }
        settled
    }

    pub(super) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    pub(super) fn scene(&self) -> &Scene {
        self.scene
    }

    pub(super) fn intrinsics(&self) -> Intrinsics {
        self.settings.intrinsics()
    }

    /// Takes photographs.
    ///
    /// # Errors
    /// Where the device fails or the system refuses a file.
    pub fn photographs(&self, cameras: &[Camera], observe: Observe) -> Result<Artifact> {
        self.photographs_in(&self.root, cameras, self.settings.samples, observe)
    }

    /// Takes the input photographs.
    ///
    /// # Errors
    /// As [`SceneArtifacts::photographs`].
    pub fn input_photographs(&self, cameras: &[Camera], observe: Observe) -> Result<Artifact> {
        self.photographs_in(&self.root, cameras, self.settings.input_samples, observe)
    }

    /// Takes the photographs that what is trained is compared with. In a room those of one colour are left out: before a lamp or in
    /// the dark PSNR is infinite or not by a rounding.
    ///
    /// # Errors
    /// As [`SceneArtifacts::photographs`], and where none is left.
    pub fn test_photographs(&self, cameras: &[Camera], observe: Observe) -> Result<Tests> {
        let artifact = self.photographs_in(&self.root, cameras, self.settings.test_samples, &mut *observe)?;
        let mut plain = HashSet::new();
        if self.kind == Kind::Room {
            for photo in read_photos(&artifact)?.photos {
                if is_plain(&photo).map_err(|error| artifact.damaged(&error.to_string()))? {
                    plain.insert(photo.camera.name);
                }
            }
        }
        if plain.len() == cameras.len() {
            let what = "every test view is of one colour throughout, which tells nothing; keep cameras with --box to where \
                        things are lit";
            return Err(Error::input(&self.scene.path, what));
        }
        if !plain.is_empty() {
            let (count, all) = (plain.len(), cameras.len());
            let note = format!("{count} of {all} test views are of one colour throughout and are left out");
            let _ = observe(ArtifactEvent::Note(note));
        }
        Ok(Tests { artifact, plain })
    }

    /// Takes a photograph of a view that a method may choose, as an artifact below `folder`.
    pub(super) fn photograph(&self, folder: &Path, photo: &Photo, observe: Observe) -> Result<Photo> {
        let artifact =
            self.photographs_in(folder, std::slice::from_ref(&photo.camera), self.settings.samples, observe)?;
        read_photos(&artifact)?.photos.into_iter().next().ok_or_else(|| artifact.damaged("it holds no photo"))
    }

    fn photographs_in(&self, root: &Path, cameras: &[Camera], samples: u32, observe: Observe) -> Result<Artifact> {
        let record = Record {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: self.scene.assembly.checksum(),
            cameras: named(cameras)?,
            samples,
            light: self.light,
            seed: SEED,
            exposure: 0.0,
            // A room's background is what its windows show; an object has none.
            show_sky: self.kind == Kind::Room,
            depth: false,
            normals: false,
            exr: false,
        };
        let artifact = Artifact::new(root, "photos", json!(record));
        if !artifact.begins(observe)? {
            return Ok(artifact);
        }
        let outputs = Outputs::new(artifact.folder(), &record, false)?;
        let all = record.cameras.len() as u32;
        // The tracer's observer cannot change anything: what it receives goes through a cell.
        let observer = std::cell::RefCell::new(observe);
        let taken = path_tracer::capture::run(&self.tracer, &record, &outputs, artifact.folder(), |_| {
            (observer.borrow_mut())(ArtifactEvent::Working)
        })?;
        if taken.empty > 0 {
            let note = format!("{} of {all} photographs show nothing of the scene", taken.empty);
            let _ = (observer.borrow_mut())(ArtifactEvent::Note(note));
        }
        // Of candidates that are photographed one by one hundreds may be.
        if !taken.dark.is_empty() && all > 1 {
            let (dark, made) = (taken.dark.len(), taken.pictures - taken.kept);
            let narrower = match (self.kind, self.settings.region.shape) {
                (Kind::Room, None) => "; --box keeps cameras to a part of it",
                _ => "",
            };
            let note = format!(
                "{dark} of {made} photographs are black: no light reaches what they see, or they are taken inside of \
                 something{narrower}"
            );
            let _ = (observer.borrow_mut())(ArtifactEvent::Note(note));
        }
        if taken.pictures < all {
            return Err(Error::Interrupted);
        }
        artifact.finish()?;
        Ok(artifact)
    }

    /// Makes what the methods are shown of the scene: the surface of the input photos, or the scene's own, with scores from
    /// these photos.
    ///
    /// # Errors
    /// Where the photos give no surface, or the device fails.
    pub fn shown(&self, inputs: &Artifact, observe: Observe) -> Result<Artifact> {
        let artifact = self.artifact(
            "surface",
            json!({ "photos": inputs.key(), "shown": self.settings.shown, "region": self.scene.region, "seed": SEED }),
        );
        if !artifact.begins(observe)? {
            return Ok(artifact);
        }
        let set = read_photos(inputs)?;
        let (surface, points) = match self.settings.shown {
            Shown::Proxy => {
                let points = self.reconstructed(&set)?;
                if let Around::Room(space) = &self.scene.views {
                    let covered = 100.0 * space.covered(&points.positions);
                    let hidden =
                        if self.settings.region.shape.is_some() { " (a part of it not seen from the box)" } else { "" };
                    let note = format!(
                        "the surface made from the input photos lies along {covered:.0}% of the scene's own{hidden}, which \
                         --surface true shows"
                    );
                    let _ = observe(ArtifactEvent::Note(note));
                }
                (Surface::Points(points), None)
            }
            Shown::True => (self.scene.surface.clone(), Some(SCORED)),
        };
        Error::unless_stopped(observe(ArtifactEvent::Working))?;
        // Photos across a room all look past its middle: from these alone it could also be an object.
        let middle = self.scene.region.bounding_sphere().0;
        let orientation = (self.kind == Kind::Room).then_some(Orientation::Inward(middle));
        let settings = vds::scoring::ScoringSettings {
            points,
            seed: SEED,
            orientation,
            ..vds::scoring::ScoringSettings::default()
        };
        let scored = vds::scoring::run(&self.context, &set, &surface, &settings, |_| {})?.points;
        artifact.write(SURFACE, &io::ply::write::surface_points(&scored))?;
        artifact.finish()?;
        Ok(artifact)
    }

    /// The surface of photos.
    ///
    /// # Errors
    /// Where they give none, or the device fails.
    pub(super) fn reconstructed(&self, set: &PhotoSet) -> Result<Points> {
        let usual = stereo::StereoOptions::default();
        let options = stereo::StereoOptions { seed: SEED, photos: usual.photos.max(set.photos.len()), ..usual };
        if let Around::Room(space) = &self.scene.views {
            // Cameras in a room have no common focus; what is nearer than a tenth of how far away walls can be is too near to be
            // found in two pictures.
            let far = space.farthest();
            let depths = Some([0.1 * far, far]);
            let options = stereo::StereoOptions { depths, hull: false, ..options };
            return match stereo::reconstruct(&self.context, set, &options) {
                Ok(found) => Ok(found.points),
                Err(Error::Request(what)) => Err(Error::input(
                    &self.scene.path,
                    format!(
                        "its input photos give no surface ({what}); give more --inputs or --spp, or show methods the scene's \
                         own mesh with --surface true"
                    ),
                )),
                Err(error) => Err(error),
            };
        }
        match stereo::reconstruct(&self.context, set, &options) {
            Ok(found) => Ok(found.points),
            // Few photos from all around see too little in common: their masks' hull is used instead.
            Err(Error::Request(_)) => stereo::hull_of(&self.context, set, &options),
            Err(error) => Err(error),
        }
    }

    /// What is shown, in a region and the space that cameras are held to, ready to be planned for. Scores belong to points, which
    /// the objective that uses scores gets, with or without them; all others get the mesh itself, whose sheets have two sides, where
    /// the mesh is shown.
    ///
    /// # Errors
    /// Where its file cannot be read any more.
    pub fn target(&self, given: MethodInputs<'_>, region: &Region, scored: bool) -> Result<Target> {
        let MethodInputs { inputs, shown } = given;
        let read = || io::read_surface(&shown.file(SURFACE)).map_err(|error| shown.damaged(&error.to_string()));
        let surface = match (self.settings.shown, scored) {
            (Shown::True, false) => self.scene.surface.clone(),
            _ => read()?,
        };
        self.held(self.target_of(&surface, region)?, &surface, || read_photos(inputs))
    }

    /// A target in the space that cameras are held to: what photos prove free, with a surface made of them.
    ///
    /// # Errors
    /// Where they prove nothing.
    pub(super) fn held(
        &self,
        target: Target,
        surface: &Surface,
        photos: impl FnOnce() -> Result<PhotoSet>,
    ) -> Result<Target> {
        if self.settings.space == Space::Open {
            return Ok(target);
        }
        let space = photos()?.known_space(surface.positions(), None, target.region.up)?;
        let limits = Limits { space: Some(space), ..target.limits.clone() };
        target.within(limits)
    }

    /// A surface in a region, ready to be planned for.
    ///
    /// # Errors
    /// Where the two make no sense together.
    pub(super) fn target_of(&self, surface: &Surface, region: &Region) -> Result<Target> {
        let choice = RegionChoice::from(*region);
        let path = self.scene.path.to_string_lossy();
        let target = Target::new(surface, &path, self.kind.preset(), &choice, region.up, &self.intrinsics())?;
        target.within(self.scene.limits.clone())
    }

    /// Trains splats on photographs and, where there are tests, evaluates these.
    ///
    /// # Errors
    /// Where photographs cannot be read any more, or the device fails or has not enough memory.
    pub fn training(
        &self,
        photos: &Artifact,
        tests: Option<&Tests>,
        seed: u64,
        observe: Observe,
    ) -> Result<(Artifact, TrainRecord)> {
        let EvaluationSettings { iterations, max_splats, degree, antialiased, .. } = self.settings;
        let config = TrainConfig {
            background: self.kind.background(),
            degree,
            antialiased,
            seed,
            ..TrainConfig::new(iterations, max_splats).with_strategy(Strategy::Mcmc, Start::Surface)
        };
        let tested = tests.map(|tests| tests.artifact.key());
        let artifact = self.artifact("training", json!({ "photos": photos.key(), "tests": tested, "config": config }));
        let split = || {
            let test = tests.map_or(Test::Every(0), |tests| Test::Capture(tests.artifact.folder().to_owned()));
            // Damaged tests are reported as an artifact, not as a capture of the user's.
            let split = Split::new(read_photos(photos)?, &test, Images::Needed.into());
            let split =
                split.or_else(|error| tests.map(|tests| read_photos(&tests.artifact)).transpose().and(Err(error)));
            split.map(|mut split| {
                split.test.retain(|photo| tests.is_none_or(|tests| !tests.plain.contains(&photo.camera.name)));
                split
            })
        };
        let capture = photos.folder().to_string_lossy().into_owned();
        training::run(&self.context, artifact, Training { capture, config, shrink: 1 }, split, observe)
    }

    pub(super) fn artifact(&self, name: &str, inputs: Value) -> Artifact {
        Artifact::new(&self.root, name, inputs)
    }
}

/// The light map of a scene.
fn light_map(
    context: &Arc<Context>,
    root: &Path,
    scene: &Scene,
    settings: &lightmap::LightmapSettings,
    eyes: &[DVec3],
    observe: Observe,
) -> Result<LightMap> {
    let places: Vec<[f64; 3]> = eyes.iter().map(DVec3::to_array).collect();
    let inputs = json!({ "scene": scene.assembly.checksum(), "settings": settings, "eyes": places });
    let artifact = Artifact::new(root, "light", inputs);
    let file = artifact.file(lightmap::FILE);
    if !artifact.begins(observe)? {
        let map = LightMap::read(&file, &scene.assembly, settings, eyes)?;
        return map.ok_or_else(|| artifact.damaged(lightmap::FILE));
    }
    let map = LightMap::bake(context, &scene.assembly, settings, eyes, |_| observe(ArtifactEvent::Working))?;
    map.write(&file, &scene.assembly, settings, eyes)?;
    artifact.finish()?;
    Ok(map)
}

/// Whether all pixels of a photo are alike.
fn is_plain(photo: &Photo) -> Result<bool, image::ImageError> {
    let Some(file) = &photo.image else { return Ok(false) };
    let picture = image::open(file)?.into_rgb8();
    Ok(picture.pixels().all(|pixel| pixel == picture.get_pixel(0, 0)))
}

/// The photographs of an artifact.
pub(super) fn read_photos(artifact: &Artifact) -> Result<PhotoSet> {
    let set = photos::read(artifact.folder(), &ReadOptions { images: Images::Optional, ..ReadOptions::default() });
    let set = set.map_err(|error| artifact.damaged(&error.to_string()))?;
    match set.missing.first() {
        Some(missing) => Err(artifact.damaged(&format!("missing or unreadable: {missing}"))),
        None => Ok(set),
    }
}
