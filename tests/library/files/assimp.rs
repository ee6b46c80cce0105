//! The models that Assimp tests its readers with, where Debian's package `assimp-testmodels` is installed.

use std::path::{Path, PathBuf};

use camsplat::files::io::read_surface_with_notes;
use camsplat::scene::surface::Surface;

const MODELS: &str = "/usr/share/assimp/models";
const READ: [&str; 5] = ["obj", "ply", "stl", "glb", "gltf"];

/// Files below a folder, in the order of names.
fn below(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            below(&path, found);
        } else if path.extension().is_some_and(|extension| READ.contains(&&*extension.to_string_lossy().to_lowercase()))
        {
            found.push(path);
        }
    }
}

/// If this failed, a model that other programs read would end the program, be read as nothing, or be refused without a reason and a way out.
#[test]
#[ignore = "needs Debian's package assimp-testmodels"]
fn every_model_loads_or_is_refused_in_a_line() {
    let mut files = Vec::new();
    below(Path::new(MODELS), &mut files);
    if files.is_empty() {
        println!("skipped: {MODELS} is not there");
        return;
    }
    let mut table = Vec::new();
    for file in &files {
        let name = file.strip_prefix(MODELS).unwrap().to_string_lossy().into_owned();
        let said = match read_surface_with_notes(file) {
            Ok((Surface::Mesh(mesh), _)) => {
                assert!(!mesh.triangles.is_empty() && mesh.positions.iter().all(|p| p.is_finite()), "{name}");
                format!("{} triangles", mesh.triangles.len())
            }
            Ok((Surface::Points(points), _)) => {
                assert!(points.positions.len() > 1 && points.positions.iter().all(|p| p.is_finite()), "{name}");
                format!("{} points", points.positions.len())
            }
            Err(error) => {
                let line = error.to_string();
                assert_eq!(line.lines().count(), 1, "{name}: {line}");
                line.split_once(": ").map_or(line.clone(), |(_, what)| what.to_owned())
            }
        };
        println!("| {name} | {said} |");
        table.push((name, said));
    }
    // Known counts, of every format and of odd ones.
    let known = [
        ("OBJ/box.obj", "12 triangles"),
        ("OBJ/box_UTF16BE.obj", "12 triangles"),
        ("OBJ/concave_polygon.obj", "triangles"),
        ("PLY/cube.ply", "12 triangles"),
        ("PLY/Wuson.ply", "3732 triangles"),
        ("STL/sphereWithHole.stl", "285 triangles"),
        ("glTF/TwoBoxes/TwoBoxes.gltf", "glTF \"1"),
        ("glTF2/BoxTextured-glTF-Binary/BoxTextured.glb", "12 triangles"),
        ("glTF2/RecursiveNodes/RecursiveNodes.gltf", "tree"),
        ("glTF2/draco/2CylinderEngine.gltf", "draco"),
    ];
    for (name, part) in known {
        let said = table.iter().find(|(own, _)| own == name).map(|(_, said)| said.to_lowercase());
        assert!(said.as_ref().is_some_and(|said| said.contains(&part.to_lowercase())), "{name}: {said:?}");
    }
}
