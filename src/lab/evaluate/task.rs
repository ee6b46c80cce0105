//! What methods of other programs choose by, as files: the surface, the region and the photographs that our methods are given.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use serde_json::json;

use super::artifact::Observe;
use super::destination::{ASKED, PREPARED};
use super::evaluation::made_for;
use super::request::EvaluationRequest;
use super::scene::Scene;
use super::scene_artifacts::{MethodInputs, SURFACE, SceneArtifacts};
use super::settings::Shown;
use super::subject::Subject;
use crate::engine::vulkan::Context;
use crate::files::io;
use crate::files::io::folder::write_files;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// The folder of these files in that of the scene, and the file that has all but the surface.
const FOLDER: &str = "task";
const TASK: &str = "task.json";
/// The scene's own mesh, where that is what methods are shown.
const MESH: &str = "mesh.ply";

/// Makes what methods choose on, for methods of other programs, and nothing else: files in the folder `task` of each scene's. Of a pool
/// there are none, as its photos are the user's. Requests of any methods go on from there.
///
/// # Errors
/// Where the photographs give no surface, `observe` stopped it, or a file cannot be written.
pub fn prepare(
    context: &Arc<Context>,
    request: &EvaluationRequest,
    subjects: &[Subject],
    folder: &Path,
    observe: Observe,
) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source))?;
    let marks = folder.join(ASKED);
    if !marks.is_file() {
        write_files(&[(&marks, PREPARED.as_bytes())])?;
    }
    for subject in subjects {
        if let Subject::Scene(scene) = subject {
            let observe = &mut made_for(subject.name().to_owned(), &mut *observe);
            write(context, request, scene, &folder.join(subject.name()), observe)?;
        }
    }
    Ok(())
}

/// Makes what methods choose on and writes it into `root`, which is the scene's folder: the scored surface, the mesh where methods are
/// shown it, and the region, limits, viewers, lens, budgets, seeds, kept photos and input photographs. All in the scene's frame, metres or
/// whatever its unit is, +Y up.
///
/// # Errors
/// Where the photographs give no surface, `observe` stopped it, or a file cannot be written.
fn write(
    context: &Arc<Context>,
    request: &EvaluationRequest,
    scene: &Scene,
    root: &Path,
    observe: Observe,
) -> Result<()> {
    let cameras = scene.inputs(context, &request.settings)?;
    let artifacts = SceneArtifacts::new(context, root, request, scene, &mut *observe)?;
    let inputs = artifacts.input_photographs(&cameras, &mut *observe)?;
    let shown = artifacts.shown(&inputs, observe)?;
    let folder = root.join(FOLDER);
    std::fs::create_dir_all(&folder).map_err(|source| Error::io(&folder, source))?;
    let surface = shown.file(SURFACE);
    let surface = std::fs::read(&surface).map_err(|source| Error::io(&surface, source))?;
    let mesh = match (&scene.surface, request.settings.shown) {
        (Surface::Mesh(mesh), Shown::True) => {
            // Methods are shown where things are; grey says nothing about their colours.
            let vertices: Vec<(DVec3, [u8; 3])> = mesh.positions.iter().map(|p| (*p, [128; 3])).collect();
            Some(io::ply::write::mesh(&vertices, &mesh.triangles))
        }
        _ => None,
    };
    let first = u64::from(request.first_seed);
    let seeds: Vec<u64> = (first..first + u64::from(request.seeds)).collect();
    let intrinsics = request.settings.intrinsics();
    // Photos that are there already, of each run.
    let mut kept = Vec::new();
    for views in &request.budgets {
        for seed in &seeds {
            let cameras = scene.kept(intrinsics, *views, *seed)?;
            if !cameras.is_empty() {
                kept.push(json!({ "views": views, "seed": seed, "cameras": cameras }));
            }
        }
    }
    let space = artifacts.target(MethodInputs { inputs: &inputs, shown: &shown }, &scene.region, false)?;
    let task = json!({
        "scene": scene.name, "surface": SURFACE, "mesh": mesh.as_ref().map(|_| MESH), "photos": format!("../{}", inputs.key()),
        "region": space.region, "limits": space.limits, "viewers": request.viewers, "camera": intrinsics,
        "budgets": request.budgets, "seeds": seeds, "kept": kept,
    });
    let task = format!("{task:#}\n");
    let [surface_file, mesh_file, task_file] = [SURFACE, MESH, TASK].map(|name| folder.join(name));
    if mesh.is_none() && mesh_file.is_file() {
        // Of an earlier request.
        std::fs::remove_file(&mesh_file).map_err(|source| Error::io(&mesh_file, source))?;
    }
    let mut files = vec![(&*surface_file, &surface[..]), (&*task_file, task.as_bytes())];
    files.extend(mesh.as_ref().map(|mesh| (&*mesh_file, &mesh[..])));
    write_files(&files)
}
