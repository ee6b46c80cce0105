//! Path tracing: rays and paths per second, without building the hierarchy.
//!
//! The scene is the sample room with a lamp in it, seen from its middle, or one that `CAMSPLAT_BENCH_SCENE` (a .glb file)
//! names, seen by the first camera of `CAMSPLAT_BENCH_CAMERAS`, under `CAMSPLAT_BENCH_ENV` where that is given. All rays that
//! paths cast are counted, shadow rays included; all but the first of each path are incoherent, and shading is included.

mod report;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use camsplat::engine::vulkan::{Context, Recorder};
use camsplat::files::io;
use camsplat::files::io::environment::read_environment;
use camsplat::files::io::gltf::read_model;
use camsplat::lab::path_tracer::assembly::Assembly;
use camsplat::lab::path_tracer::tracer::{Exposure, Strategy, Tracer};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::model::{Environment, Face, Lamp, LampKind, Material, Model, Vertex};
use camsplat::scene::samples;
use camsplat::scene::surface::Surface;
use camsplat::{Error, Result};
use glam::{DVec3, Vec3, Vec4};
use report::{Amount, Job, Report};

/// Side of the picture; an eighth of it on CPU devices.
const SIDE: u32 = 800;

fn main() -> ExitCode {
    report::run("photograph", rows)
}

fn rows(context: Arc<Context>, report: &mut Report) -> Result<()> {
    let (name, model, environment, camera) = match std::env::var_os("CAMSPLAT_BENCH_SCENE").map(PathBuf::from) {
        None => own(),
        Some(path) => given(&path)?,
    };
    let start = Instant::now();
    let assembly = Assembly::new(&model, environment.as_ref())?;
    let seconds = start.elapsed().as_secs_f64();
    println!("{name}: {} triangles, hierarchy and tables made in {seconds:.3} s", model.faces.len());
    report.facts(serde_json::json!({
        "name": format!("{name}/build"), "triangles": model.faces.len(), "wall_seconds": seconds,
    }));
    drop(assembly);
    trace(&context, report, &name, (&model, environment.as_ref()), &camera)
}

/// A dispatch of one sample on CPU devices, and of eight on others.
fn trace(
    context: &Arc<Context>,
    report: &mut Report,
    name: &str,
    (model, environment): (&Model, Option<&Environment>),
    camera: &Camera,
) -> Result<()> {
    let on_cpu = context.physical().is_cpu();
    let side = if on_cpu { SIDE / 8 } else { SIDE };
    let intrinsics = camera.intrinsics.resized(side, side).unwrap_or(Intrinsics::from_fov(side, side, 1.0));
    let camera = Camera { intrinsics, ..camera.clone() };
    let samples = if on_cpu { 1 } else { 8 };
    let pixels = side * side;
    let exposure = Exposure { samples, seed: 1, show_sky: true };
    let tracer = |count_rays| {
        let assembly = Assembly::new(model, environment)?;
        Tracer::with(context, assembly, u64::from(pixels), Strategy::Both, count_rays)
    };
    let counting = tracer(true)?;
    let mut commands = Recorder::new(context)?;
    counting.record_part(&mut commands, &camera, exposure, [0, pixels], [0, samples])?;
    commands.submit_and_wait()?;
    let rays: f64 = counting.sums(pixels as usize)?.iter().map(|sum| f64::from(sum[3])).sum();
    drop(commands);
    drop(counting);
    let tracer = tracer(false)?;
    let paths = u64::from(pixels) * u64::from(samples);
    println!("{name}: {:.2} rays a path", rays / paths as f64);
    report.row(
        &format!("{name}_rays"),
        Amount { count: rays as u64, bytes: 0, operations: 0 },
        &mut job(context, &tracer, &camera, exposure)?,
    )?;
    report.row(
        &format!("{name}_paths"),
        Amount { count: paths, bytes: 0, operations: 0 },
        &mut job(context, &tracer, &camera, exposure)?,
    )
}

/// A recording of a whole picture.
fn job(context: &Arc<Context>, tracer: &Tracer, camera: &Camera, exposure: Exposure) -> Result<Job> {
    let pixels = camera.intrinsics.width * camera.intrinsics.height;
    Job::new(
        context,
        1,
        |_| {},
        |recorder| tracer.record_part(recorder, camera, exposure, [0, pixels], [0, exposure.samples]),
    )
}

/// The sample room in grey, with a lamp under its ceiling.
fn own() -> (String, Model, Option<Environment>, Camera) {
    let mut model = Model::default();
    if let Surface::Mesh(mesh) = samples::room() {
        let vertex = |position: &DVec3| Vertex { position: *position, colour: [255; 4], ..Vertex::default() };
        model.vertices = mesh.positions.iter().map(vertex).collect();
        model.faces = mesh.triangles.iter().map(|corners| Face { corners: *corners, material: 0 }).collect();
    }
    let plastic =
        Material { metallic: 0.0, base: Vec4::new(0.6, 0.6, 0.6, 1.0), roughness: 0.5, ..Material::default() };
    model.materials.push(plastic);
    model.lamps.push(Lamp {
        kind: LampKind::Point,
        position: DVec3::new(3.0, 2.0, 2.4),
        direction: Vec3::NEG_Z,
        colour: Vec3::splat(10.0),
        range: f32::INFINITY,
    });
    let pose = Pose::looking(DVec3::new(3.0, 2.0, 1.5), DVec3::new(1.0, 0.4, -0.2), DVec3::Z);
    let intrinsics = Intrinsics::from_fov(SIDE, SIDE, 1.2);
    ("demo_room".into(), model, None, Camera { name: "middle".into(), pose, intrinsics })
}

fn given(path: &std::path::Path) -> Result<(String, Model, Option<Environment>, Camera)> {
    let file = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let Some(cameras) = file("CAMSPLAT_BENCH_CAMERAS") else {
        return Err(Error::request("CAMSPLAT_BENCH_SCENE needs CAMSPLAT_BENCH_CAMERAS, a file with a camera"));
    };
    let mut notes = Vec::new();
    let environment = file("CAMSPLAT_BENCH_ENV").map(|path| read_environment(&path, &mut notes)).transpose()?;
    let camera = io::read_cameras(&cameras)?.swap_remove(0);
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok((name, read_model(path, &mut notes)?, environment, camera))
}
