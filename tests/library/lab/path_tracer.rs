//! Photographs of scenes whose light is known in closed form.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use crate::support::device::context;
use crate::support::photographs::{add_ball, add_quad, ball, camera, lambert, mean, photograph, photograph_by};
use camsplat::engine::vulkan::Recorder;
use camsplat::lab::path_tracer::albedo;
use camsplat::lab::path_tracer::assembly::Assembly;
use camsplat::lab::path_tracer::tracer::{Exposure, Strategy, Tracer};
use camsplat::scene::model::{Alpha, Environment, Image, Lamp, LampKind, Map, Material, Model, Wrap};
use glam::{DVec3, Mat3, Vec3, Vec4};

/// Materials that should neither gain nor lose light, each with one lobe, or a stack of them.
fn lossless() -> Vec<(String, Material)> {
    let metal = |roughness| Material { metallic: 1.0, roughness, ..Material::default() };
    let plastic = |roughness| Material { metallic: 0.0, roughness, ..Material::default() };
    let glass = |roughness, ior| Material { transmission: 1.0, volume: true, ior, ..plastic(roughness) };
    let mut all = vec![("lambert".to_owned(), lambert(1.0))];
    for roughness in [0.0, 0.3, 0.6, 1.0] {
        all.push((format!("metal {roughness}"), metal(roughness)));
        all.push((format!("plastic {roughness}"), plastic(roughness)));
        all.push((format!("glass {roughness}"), glass(roughness, 1.5)));
        let coat = Material { clearcoat: 1.0, clearcoat_roughness: roughness, ..metal(0.5) };
        all.push((format!("coat {roughness}"), coat));
        let thin = Material { transmission: 1.0, ..plastic(roughness) };
        all.push((format!("thin sheet {roughness}"), thin));
    }
    for roughness in [0.2, 0.5, 1.0] {
        let sheen = Material { sheen: Vec3::ONE, sheen_roughness: roughness, ..plastic(0.8) };
        all.push((format!("sheen {roughness}"), sheen));
    }
    for roughness in [0.0, 0.5] {
        let coat = Material { clearcoat: 0.5, clearcoat_roughness: roughness, ..plastic(0.3) };
        all.push((format!("half a coat {roughness}"), coat));
        let dim = Material { specular: 0.5, ..plastic(roughness) };
        all.push((format!("half specular {roughness}"), dim));
    }
    all.push(("half glass".into(), Material { transmission: 0.5, volume: true, ..plastic(0.4) }));
    let blend = Material { base: Vec4::new(1.0, 1.0, 1.0, 0.5), alpha: Alpha::Blend, ..plastic(0.5) };
    all.push(("blend".into(), blend));
    all
}

/// If this failed, a material would make light or swallow it: under a sky that is as bright everywhere, a lossless ball cannot be
/// distinguished from the sky.
#[test]
fn lossless_balls_vanish_in_a_white_furnace() {
    let sky = Environment::uniform(Vec3::ONE);
    // The ball fills the picture, down to grazing directions in its corners.
    let camera = camera(DVec3::new(0.0, 0.5, 4.0), DVec3::ZERO, 24, 0.34);
    for (name, material) in lossless() {
        let model = ball(material);
        let assembly = Assembly::new(&model, Some(&sky)).unwrap();
        let tracer = Tracer::new(&context(), assembly, 24 * 24).unwrap();
        // The sky is shown through the ball where light passes it straight.
        let exposure = Exposure { samples: 160, seed: 1, show_sky: true };
        let taken = tracer.photograph(&camera, 0, exposure, || ControlFlow::Continue(())).unwrap();
        let found = mean(&taken);
        println!("{name}: {found}");
        assert!((found - Vec3::ONE).abs().max_element() < 0.01, "{name}: {found}");
    }
}

/// If this failed, a refracting interface would make light or swallow it, from one of its sides, at some angle or roughness. One
/// hit of a plane, since a ball of diamond traps light for longer than a path is followed.
#[test]
fn interfaces_of_glass_and_diamond_keep_all_light() {
    let sky = Environment::uniform(Vec3::ONE);
    let mut model = Model::default();
    let mut places = Vec::new();
    for ior in [1.33, 1.5, 2.4] {
        for roughness in [0.0, 0.2, 0.6, 1.0] {
            let glass =
                Material { metallic: 0.0, roughness, transmission: 1.0, volume: true, ior, ..Material::default() };
            let place = 10.0 * places.len() as f64 * DVec3::X;
            add_quad(&mut model, place, 4.0 * DVec3::Z, 4.0 * DVec3::X, glass);
            places.push((ior, roughness, place));
        }
    }
    let tracer = Tracer::new(&context(), Assembly::new(&model, Some(&sky)).unwrap(), 16 * 16).unwrap();
    for (ior, roughness, place) in places {
        for degrees in [20.0f64, 75.0] {
            for side in [1.0, -1.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let camera = camera(place + 3.0 * DVec3::new(0.0, side * cos, sin), place, 16, 0.02);
                let exposure = Exposure { samples: 128, seed: 1, show_sky: true };
                let taken = tracer.photograph(&camera, 0, exposure, || ControlFlow::Continue(())).unwrap();
                let found = mean(&taken).x;
                let what = format!("index {ior}, roughness {roughness}, {degrees} degrees, side {side}: {found}");
                println!("{what}");
                assert!((found - 1.0).abs() < 0.01, "{what}");
            }
        }
    }
}

/// Irradiance under a rectangle of unit radiance that hangs parallel above a place at the height `h` with its corner right
/// above it and sides `a` and `b`: Lambert's formula.
fn corner_irradiance(a: f64, b: f64, h: f64) -> f64 {
    let part = |a: f64, b: f64| a / (a * a + h * h).sqrt() * (b / (a * a + h * h).sqrt()).atan();
    0.5 * (part(a, b) + part(b, a))
}

/// If this failed, areas, cosines or distances of lamps would be reckoned wrongly, and every interior be too bright or dark.
#[test]
fn a_plane_under_a_rectangle_of_light_is_as_bright_as_lambert_says() {
    let mut model = Model::default();
    add_quad(&mut model, DVec3::ZERO, 5.0 * DVec3::Z, 5.0 * DVec3::X, lambert(0.6));
    let shining = Material { emission: Vec3::new(3.0, 2.0, 1.0), ..Material { double_sided: false, ..lambert(0.0) } };
    add_quad(&mut model, DVec3::new(0.0, 1.5, 0.0), 0.5 * DVec3::X, 0.8 * DVec3::Z, shining);
    // Looks at a spot of a hundredth around the origin.
    let camera = camera(DVec3::new(3.0, 1.0, 0.0), DVec3::ZERO, 64, 0.004);
    let irradiance = 4.0 * corner_irradiance(0.5, 0.8, 1.5);
    let wanted = 0.6 / PI * irradiance;
    for strategy in [Strategy::Both, Strategy::Lights, Strategy::Chance] {
        let found = mean(&photograph_by(&model, None, &camera, 32, strategy)) / Vec3::new(3.0, 2.0, 1.0);
        println!("{strategy:?}: {found} {wanted}");
        assert!((found / wanted as f32 - 1.0).abs().max_element() < 0.02, "{strategy:?}: {found}, not {wanted}");
    }
}

/// If this failed, lamps without extent would be of another strength or direction than specified.
#[test]
fn lamps_light_a_plane_as_their_definition_says() {
    let place = DVec3::new(1.0, 2.0, 0.0);
    let direction = -place.normalize().as_vec3();
    let (d2, cos) = (place.length_squared(), place.normalize().y);
    let spot = |inner: f32, outer: f32| LampKind::Spot { inner, outer };
    for (kind, aim, wanted) in [
        (LampKind::Point, direction, cos / d2),
        (spot(0.1, 0.3), direction, cos / d2),
        (spot(0.1, 0.2), Vec3::X, 0.0),
        (LampKind::Directional, direction, cos),
    ] {
        let mut model = Model::default();
        add_quad(&mut model, DVec3::ZERO, 5.0 * DVec3::Z, 5.0 * DVec3::X, lambert(0.5));
        let lamp = Lamp { kind, position: place, direction: aim, colour: Vec3::splat(4.0), range: f32::INFINITY };
        model.lamps.push(lamp);
        let camera = camera(DVec3::new(0.0, 3.0, 1.0), DVec3::ZERO, 4, 0.002);
        let found = mean(&photograph(&model, None, &camera, 4));
        let wanted = (4.0 * 0.5 / PI * wanted) as f32;
        assert!((found.x - wanted).abs() < 2e-3 * wanted.max(1e-3), "{kind:?}: {found}, not {wanted}");
    }
}

/// If this failed, rays would start so far off a large triangle that they pass over objects on it: half of what the camera
/// looks at lies in the shadow of a wall a twenty-thousandth as high as the floor's half side.
#[test]
fn what_stands_on_a_huge_floor_throws_its_whole_shadow() {
    for half in [1.0, 1000.0] {
        let mut model = Model::default();
        let place = DVec3::new(0.1, 0.0, 0.23) * half;
        add_quad(&mut model, DVec3::ZERO, half * DVec3::Z, half * DVec3::X, lambert(0.5));
        let wall = place + DVec3::new(-0.05, 0.025, 0.0);
        add_quad(&mut model, wall, 0.025 * DVec3::Y, DVec3::Z, lambert(0.0));
        let direction = Vec3::new(1.0, -1.0, 0.0).normalize();
        let colour = Vec3::ONE;
        model.lamps.push(Lamp {
            kind: LampKind::Directional,
            position: DVec3::ZERO,
            direction,
            colour,
            range: f32::INFINITY,
        });
        // From above, as far as 0.05 to each side of the shadow's end.
        let camera = camera(place + DVec3::new(0.0, 1.0, 1e-3), place, 64, 2.0 * 0.05f64.atan());
        let lit = f64::from(mean(&photograph(&model, None, &camera, 16)).x) / (0.5 / PI * 0.5f64.sqrt());
        println!("half side {half}: {lit}");
        assert!((lit - 0.5).abs() < 0.02, "half side {half}: {lit} is lit");
    }
}

/// A sky that shines from above, or from below.
fn half_sky(above: bool) -> Environment {
    let (width, height) = (64, 32);
    let light = |i: u32| if (i / width < height / 2) == above { Vec3::ONE } else { Vec3::ZERO };
    Environment { width, height, radiance: (0..width * height).map(light).collect() }
}

/// If this failed, glass would be too much of a mirror or too little, or its edge between passing and total reflection be at
/// another angle.
#[test]
fn a_glass_interface_splits_light_as_fresnel_says() {
    let glass = Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, volume: true, ..Material::default() };
    // By sines and tangents of both angles, in double precision, of an index of 1.5.
    let angles = [5.0f64, 30.0, 50.0, 65.0];
    for (from_within, eta, shares) in
        [(false, 1.5f32, [0.04000, 0.04152, 0.05766, 0.12051]), (true, 1.0 / 1.5, [0.04000, 0.05519, 1.0, 1.0])]
    {
        let mut model = Model::default();
        let sign = if from_within { -1.0 } else { 1.0 };
        add_quad(&mut model, DVec3::ZERO, 50.0 * DVec3::Z, sign * 50.0 * DVec3::X, glass.clone());
        for (degrees, wanted) in angles.into_iter().zip(shares) {
            let angle = degrees.to_radians();
            let camera = camera(3.0 * DVec3::new(angle.sin(), angle.cos(), 0.0), DVec3::ZERO, 64, 0.002);
            assert!((albedo::fresnel(angle.cos() as f32, eta) - wanted).abs() < 1e-4, "{degrees} degrees");
            let reflected = mean(&photograph(&model, Some(&half_sky(true)), &camera, 16)).x;
            let passed = mean(&photograph(&model, Some(&half_sky(false)), &camera, 16)).x;
            assert!((reflected - wanted).abs() < 0.01, "{degrees} degrees: {reflected} and not {wanted} is reflected");
            assert!(
                (passed - (1.0 - wanted)).abs() < 0.01,
                "{degrees} degrees: {passed} and not {} passes",
                1.0 - wanted
            );
        }
    }
}

/// If this failed, a tinted body would be too dark or light for its thickness.
#[test]
fn a_body_absorbs_by_its_thickness() {
    let mut model = Model::default();
    let absorption = Vec3::new(0.0, 0.5, 2.0);
    let body =
        Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, volume: true, absorption, ..Material::default() };
    add_quad(&mut model, 0.5 * DVec3::Y, 50.0 * DVec3::Z, 50.0 * DVec3::X, body.clone());
    add_quad(&mut model, -0.5 * DVec3::Y, 50.0 * DVec3::X, 50.0 * DVec3::Z, body);
    let camera = camera(3.0 * DVec3::Y, DVec3::ZERO, 64, 0.002);
    let found = mean(&photograph(&model, Some(&half_sky(false)), &camera, 32));
    // Straight on: (1 - r)^2 pass, and what is reflected within twice more, r^2 at a time.
    let r = 0.04f32;
    let wanted = absorption.map(|a| {
        let once = (-a).exp();
        (1.0 - r) * (1.0 - r) * once / (1.0 - r * r * once * once)
    });
    assert!((found - wanted).abs().max_element() < 0.015, "{found}, not {wanted}");
}

/// A floor, a rough metal ball and a plastic one under a sky with a sun, with a lamp of some extent and a thin sheet.
fn mixed() -> (Model, Environment) {
    let mut model = Model::default();
    add_quad(&mut model, DVec3::ZERO, 3.0 * DVec3::Z, 3.0 * DVec3::X, lambert(0.5));
    let metal = Material { base: Vec4::new(0.9, 0.6, 0.3, 1.0), metallic: 1.0, roughness: 0.5, ..Material::default() };
    add_ball(&mut model, DVec3::new(-0.6, 0.5, 0.0), 0.5, metal);
    let coated = Material { clearcoat: 1.0, clearcoat_roughness: 0.4, roughness: 0.6, ..lambert(0.7) };
    let cloth = Material { sheen: Vec3::splat(0.8), sheen_roughness: 0.5, specular: 1.0, ..coated };
    add_ball(&mut model, DVec3::new(0.6, 0.5, 0.0), 0.5, cloth);
    let sheet = Material { transmission: 0.8, roughness: 0.5, metallic: 0.0, ..Material::default() };
    add_quad(&mut model, DVec3::new(0.0, 0.6, 1.0), 0.4 * DVec3::X, 0.3 * DVec3::Y, sheet);
    let lamp = Material { emission: Vec3::splat(4.0), ..lambert(0.0) };
    add_quad(&mut model, DVec3::new(0.0, 2.0, -0.5), 0.4 * DVec3::X, 0.4 * DVec3::Z, lamp);
    let (width, height) = (32, 16);
    let light = |i: u32| Vec3::splat(if i == 5 * width + 9 { 20.0 } else { 0.2 });
    (model, Environment { width, height, radiance: (0..width * height).map(light).collect() })
}

/// If this failed, one of the two ways to find light would be wrong, or both weighted so that their sum is: pictures would
/// change with the size of lamps.
#[test]
fn the_mean_does_not_depend_on_how_lights_are_found() {
    let (model, sky) = mixed();
    let camera = camera(DVec3::new(0.5, 1.5, 4.0), DVec3::new(0.0, 0.5, 0.0), 24, 0.6);
    let of = |strategy| mean(&photograph_by(&model, Some(&sky), &camera, 1024, strategy));
    let both = of(Strategy::Both);
    for strategy in [Strategy::Lights, Strategy::Chance] {
        let found = of(strategy);
        println!("{strategy:?}: {found}, both: {both}");
        assert!((found / both - 1.0).abs().max_element() < 0.015, "{strategy:?}: {found}, both ways: {both}");
    }
}

/// If this failed, pictures would depend on the machine: on the size of its batches, or on what ran before.
#[test]
fn neither_tiles_nor_batches_show() {
    let (model, sky) = mixed();
    let camera = camera(DVec3::new(0.5, 1.5, 4.0), DVec3::new(0.0, 0.5, 0.0), 20, 0.6);
    let tracer = Tracer::new(&context(), Assembly::new(&model, Some(&sky)).unwrap(), 400).unwrap();
    let exposure = Exposure { samples: 6, seed: 3, show_sky: false };
    let sums = |parts: &[([u32; 2], &[[u32; 2]])]| {
        for (pixels, batches) in parts {
            let mut commands = Recorder::new(&context()).unwrap();
            for samples in *batches {
                tracer.record_part(&mut commands, &camera, exposure, *pixels, *samples).unwrap();
            }
            commands.submit_and_wait().unwrap();
        }
        tracer.sums(400).unwrap()
    };
    let whole = sums(&[([0, 400], &[[0, 6]])]);
    let singly = sums(&[([0, 400], &[[0, 1], [1, 1], [2, 1], [3, 1], [4, 1], [5, 1]])]);
    let tiled = sums(&[([130, 270], &[[0, 4], [4, 2]]), ([0, 130], &[[0, 1], [1, 5]])]);
    assert!(whole == singly && whole == tiled);
    let taken = |seed| {
        let exposure = Exposure { seed, ..exposure };
        tracer.photograph(&camera, 0, exposure, || ControlFlow::Continue(())).unwrap().pixels
    };
    assert!(taken(3) == taken(3) && taken(3) != taken(4));
    assert!(taken(3) == whole.iter().map(|sum| sum.map(|v| v / 6.0)).collect::<Vec<_>>());
}

/// An image of one row: opaque red, then green of which alpha is 0.25.
fn striped(alpha: Alpha) -> Model {
    let mut model = Model::default();
    let map = Map { image: 0, set: 0, transform: Mat3::IDENTITY, wrap: [Wrap::Clamp; 2] };
    let material = Material { base_map: Some(map), alpha, unlit: true, ..lambert(1.0) };
    add_quad(&mut model, DVec3::ZERO, DVec3::X, DVec3::Y, material);
    let pixels = [[[255, 0, 0, 255]; 4], [[0, 255, 0, 64]; 4]].concat();
    model.images.push(Image { width: 8, height: 1, pixels });
    model
}

/// If this failed, leaves would be squares, or the background be mixed into what is half transparent.
#[test]
fn alpha_is_what_its_mode_says() {
    let camera = camera(3.0 * DVec3::Z, DVec3::ZERO, 8, 2.0 * (1.0f64 / 3.0).atan());
    for (alpha, wanted) in [
        (Alpha::Opaque, [0.0, 1.0, 0.0, 1.0]),
        (Alpha::Mask(0.5), [0.0; 4]),
        (Alpha::Mask(0.2), [0.0, 1.0, 0.0, 1.0]),
        (Alpha::Blend, [0.0, 0.251, 0.0, 0.251]),
    ] {
        let taken = photograph(&striped(alpha), None, &camera, 2048);
        let [left, right] = [taken.pixels[8 * 4 + 1], taken.pixels[8 * 4 + 6]];
        assert_eq!(left, [1.0, 0.0, 0.0, 1.0], "{alpha:?}");
        let off = right.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 0.03, "{alpha:?}: {right:?}, not {wanted:?}");
    }
}

/// If this failed, bumps would be dents, or lie along the wrong side: a normal map that leans to the right by 30 degrees makes a
/// mirror show the sky at 60 from there.
#[test]
fn normal_maps_lean_the_way_they_say() {
    let map = Map { image: 0, set: 0, transform: Mat3::IDENTITY, wrap: [Wrap::Repeat; 2] };
    let mut shown = Vec::new();
    // Leaning to +u; and to the top of the image, which is where v is small.
    for pixel in [[191, 128, 238, 255], [128, 191, 238, 255]] {
        let mut model = Model::default();
        let mirror = Material { metallic: 1.0, roughness: 0.0, normal_map: Some(map), ..Material::default() };
        add_quad(&mut model, DVec3::ZERO, DVec3::X, DVec3::Y, mirror);
        // The image's v runs down, so that its top is at the lower edge of this rectangle, whose v runs up.
        for vertex in &mut model.vertices {
            vertex.normal = Vec3::Z;
            vertex.tangent = Vec4::new(1.0, 0.0, 0.0, -1.0);
        }
        model.images.push(Image { width: 1, height: 1, pixels: vec![pixel] });
        // Red from the right (+X), green from above, blue from below.
        let (width, height) = (64, 32);
        let light = |i: u32| {
            let (x, y) = (i % width, i / width);
            let right = y > 8 && y < 24 && x.abs_diff(32) < 8;
            Vec3::new(f32::from(right), f32::from(y < 8), f32::from(y > 24))
        };
        let sky = Environment { width, height, radiance: (0..width * height).map(light).collect() };
        let camera = camera(3.0 * DVec3::Z, DVec3::ZERO, 4, 0.01);
        shown.push(mean(&photograph(&model, Some(&sky), &camera, 64)));
    }
    assert!((shown[0] - Vec3::X).abs().max_element() < 0.02, "{shown:?}");
    assert!((shown[1] - Vec3::Z).abs().max_element() < 0.02, "{shown:?}");
}

/// If this failed, depths or normals would belong to another place than the picture.
#[test]
fn the_middle_of_a_pixel_is_where_the_surface_is() {
    let mut model = ball(lambert(0.5));
    model.lamps.push(Lamp {
        kind: LampKind::Directional,
        position: DVec3::ZERO,
        direction: Vec3::NEG_Y,
        colour: Vec3::ONE,
        range: f32::INFINITY,
    });
    let camera = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 33, 0.8);
    let tracer = Tracer::new(&context(), Assembly::new(&model, None).unwrap(), 33 * 33).unwrap();
    let all = tracer.first_hits(&camera, None).unwrap();
    let middle = all[33 * 16 + 16];
    assert!((middle[3] - 4.0).abs() < 0.01 && (middle[2] - 1.0).abs() < 0.02, "{middle:?}");
    assert_eq!(all[0], [0.0; 4]);
    let some = tracer.first_hits(&camera, Some(&[33 * 16 + 16, 0])).unwrap();
    assert_eq!(some, [middle, [0.0; 4]]);
}

/// If this failed, a scene in the dark would silently come out black after hours.
#[test]
fn a_scene_without_light_is_refused() {
    let refusal = Assembly::new(&ball(lambert(0.5)), None).err().unwrap().to_string();
    assert!(refusal.contains("no light") && refusal.contains("`env`"), "{refusal}");
}
