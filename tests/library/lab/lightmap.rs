//! Light maps: photographs of scenes whose light is known in closed form, or as paths from every pixel find it.

use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::path::PathBuf;

use crate::support::device::context;
use crate::support::photographs::{add_quad, ball, camera, lambert, mean, photograph};
use camsplat::lab::path_tracer::assembly::Assembly;
use camsplat::lab::path_tracer::lightmap::{LightMap, LightmapSettings};
use camsplat::lab::path_tracer::tracer::{Exposure, Photograph, Tracer};
use camsplat::scene::camera::Camera;
use camsplat::scene::model::{Environment, Lamp, LampKind, Material, Model};
use camsplat::scene::samples;
use glam::{DVec3, Vec3};

const SETTINGS: LightmapSettings = LightmapSettings { cells: 4000, rays: 256, tolerance: 0.02, samples: 16, seed: 1 };

fn baked(
    model: &Model,
    sky: Option<&Environment>,
    camera: &Camera,
    settings: LightmapSettings,
) -> (LightMap, Photograph) {
    let context = context();
    let assembly = Assembly::new(model, sky).unwrap();
    let eyes = [camera.pose.position];
    let light = LightMap::bake(&context, &assembly, &settings, &eyes, |_| ControlFlow::Continue(())).unwrap();
    let pixels = u64::from(camera.intrinsics.width) * u64::from(camera.intrinsics.height);
    let tracer = Tracer::lit(&context, &assembly, pixels, &light).unwrap();
    let exposure = Exposure { samples: 16, seed: 1, show_sky: true };
    let taken = tracer.photograph(camera, 0, exposure, || ControlFlow::Continue(())).unwrap();
    assert_eq!(context.messages(), Vec::<String>::new(), "the validation layers found fault");
    (light, taken)
}

/// If this failed, baked light would be made or lost at some angle or bounce: in a closed box whose walls shine and reflect, all is as
/// bright as a geometric series says.
#[test]
fn a_closed_furnace_is_as_bright_as_its_series() {
    let albedo = 0.6;
    let mut model = Model::default();
    let wall = Material { emission: Vec3::splat(0.2), ..lambert(albedo) };
    for (place, u, v) in [
        (DVec3::NEG_Y, DVec3::Z, DVec3::X),
        (DVec3::Y, DVec3::X, DVec3::Z),
        (DVec3::NEG_Z, DVec3::X, DVec3::Y),
        (DVec3::Z, DVec3::Y, DVec3::X),
        (DVec3::NEG_X, DVec3::Y, DVec3::Z),
        (DVec3::X, DVec3::Z, DVec3::Y),
    ] {
        add_quad(&mut model, place, u, v, wall.clone());
    }
    let (_, taken) = baked(&model, None, &camera(DVec3::ZERO, DVec3::new(0.3, 0.2, 1.0), 24, 1.2), SETTINGS);
    let wanted = 0.2 / (1.0 - albedo);
    for pixel in &taken.pixels {
        assert!((pixel[0] / wanted - 1.0).abs() < 0.03, "{} in place of {wanted}", pixel[0]);
    }
}

/// If this failed, the light of lamps with an area would be baked with wrong areas, cosines or distances.
#[test]
fn a_floor_under_a_square_light_is_as_bright_as_lambert_says() {
    let mut model = Model::default();
    add_quad(&mut model, DVec3::ZERO, 5.0 * DVec3::Z, 5.0 * DVec3::X, lambert(0.6));
    let shining = Material { emission: Vec3::new(3.0, 2.0, 1.0), ..Material { double_sided: false, ..lambert(0.0) } };
    add_quad(&mut model, DVec3::new(0.0, 1.5, 0.0), 0.5 * DVec3::X, 0.8 * DVec3::Z, shining);
    let (_, taken) = baked(
        &model,
        None,
        &camera(DVec3::new(3.0, 1.0, 0.0), DVec3::ZERO, 16, 0.02),
        LightmapSettings { cells: 40_000, rays: 64, ..SETTINGS },
    );
    let part = |a: f64, b: f64, h: f64| a / (a * a + h * h).sqrt() * (b / (a * a + h * h).sqrt()).atan();
    let corner = 0.5 * (part(0.5, 0.8, 1.5) + part(0.8, 0.5, 1.5));
    let wanted = (0.6 / PI * 4.0 * corner) as f32;
    let found = mean(&taken) / Vec3::new(3.0, 2.0, 1.0);
    assert!((found / wanted - 1.0).abs().max_element() < 0.02, "{found}, not {wanted}");
}

/// If this failed, lamps without extent and suns would be dimmer or brighter than their definition says, or their light be baked twice.
#[test]
fn compact_sources_are_looked_for_at_the_pixel_and_count_once() {
    let mut model = Model::default();
    add_quad(&mut model, DVec3::ZERO, 5.0 * DVec3::Z, 5.0 * DVec3::X, lambert(0.5));
    let camera = camera(DVec3::new(0.0, 3.0, 1.0), DVec3::ZERO, 8, 0.01);
    let mut sky = Environment { width: 256, height: 128, radiance: vec![Vec3::splat(0.2); 256 * 128] };
    // A sun of two texels, 45 degrees high.
    sky.radiance[32 * 256 + 10] = Vec3::splat(2000.0);
    sky.radiance[32 * 256 + 11] = Vec3::splat(2000.0);
    let (_, taken) = baked(&model, Some(&sky), &camera, SETTINGS);
    let traced = mean(&photograph(&model, Some(&sky), &camera, 2048));
    let found = mean(&taken);
    assert!((found / traced - 1.0).abs().max_element() < 0.02, "{found}, not {traced}");

    let (place, colour) = (DVec3::new(1.0, 2.0, 0.0), Vec3::splat(4.0));
    let direction = -place.normalize().as_vec3();
    model.lamps.push(Lamp { kind: LampKind::Point, position: place, direction, colour, range: f32::INFINITY });
    let (_, taken) = baked(&model, None, &camera, SETTINGS);
    let wanted = (4.0 * 0.5 / PI * place.normalize().y / place.length_squared()) as f32;
    let found = mean(&taken);
    assert!((found / wanted - 1.0).abs().max_element() < 0.02, "{found}, not {wanted}");
}

/// Errors of blocks of four by four pixels, since paths are noisy, relative to the light; sorted.
fn errors(taken: &Photograph, traced: &Photograph, side: usize) -> Vec<f32> {
    let block = |of: &Photograph, i: usize| {
        let (x, y) = (4 * (i % (side / 4)), 4 * (i / (side / 4)));
        let pixels = (0..16).map(|k| of.pixels[(y + k / 4) * side + x + k % 4]);
        pixels.map(|p| Vec3::new(p[0], p[1], p[2])).sum::<Vec3>() / 16.0
    };
    let error = |i| {
        let (found, wanted) = (block(taken, i), block(traced, i));
        ((found - wanted) / (wanted.max_element() + 0.02)).abs().max_element()
    };
    let mut errors: Vec<f32> = (0..side * side / 16).map(error).collect();
    errors.sort_by(f32::total_cmp);
    errors
}

/// If this failed, shadows of a sun in haze would be blurred over cells, as those under the desks of a classroom once were.
#[test]
fn a_hazy_sun_casts_its_shadows_at_the_pixel() {
    let mut model = Model::default();
    add_quad(&mut model, DVec3::ZERO, 3.0 * DVec3::Z, 3.0 * DVec3::X, lambert(0.5));
    // A bar across the sun's light.
    add_quad(&mut model, DVec3::new(0.0, 0.3, 0.0), 0.08 * DVec3::Z, 2.0 * DVec3::X, lambert(0.5));
    let mut sky = Environment { width: 256, height: 128, radiance: vec![Vec3::splat(0.2); 256 * 128] };
    for (i, texel) in sky.radiance.iter_mut().enumerate() {
        let [x, y] = [i % 256, i / 256].map(|v| v as f64);
        // Five degrees around a place 30 degrees off the zenith.
        let wide = (x - 64.0) * 0.5;
        if wide * wide + (y - 21.0) * (y - 21.0) < 14.0 {
            *texel = Vec3::splat(60.0);
        }
    }
    let camera = camera(DVec3::new(2.0, 1.5, 1.5), DVec3::ZERO, 32, 0.4);
    let (_, taken) = baked(&model, Some(&sky), &camera, LightmapSettings { cells: 1000, ..SETTINGS });
    let errors = errors(&taken, &photograph(&model, Some(&sky), &camera, 512), 32);
    assert!(errors[57] < 0.05, "a tenth of the blocks differ by {}", errors[57]);
}

/// If this failed, walls would lack what glossy floors throw on them, or have it twice: of lamps, and of suns.
#[test]
fn a_glossy_floor_throws_light_on_a_wall() {
    let mut model = Model::default();
    let floor = Material { metallic: 1.0, roughness: 0.4, base: Vec3::splat(0.8).extend(1.0), ..Material::default() };
    add_quad(&mut model, DVec3::ZERO, 2.0 * DVec3::Z, 2.0 * DVec3::X, floor);
    add_quad(&mut model, DVec3::new(0.0, 1.0, -1.0), 2.0 * DVec3::X, DVec3::Y, lambert(0.6));
    let camera = camera(DVec3::new(0.0, 0.8, 1.5), DVec3::new(0.0, 0.5, -1.0), 12, 0.3);
    let mut lit = model.clone();
    let lamp = Material { emission: Vec3::splat(6.0), ..Material { double_sided: false, ..lambert(0.0) } };
    add_quad(&mut lit, DVec3::new(0.0, 1.2, 1.9), 0.8 * DVec3::Y, 0.8 * DVec3::X, lamp);
    let mut sky = Environment { width: 256, height: 128, radiance: vec![Vec3::splat(0.1); 256 * 128] };
    // A sun before the wall, 37 degrees high.
    sky.radiance.iter_mut().skip(38 * 256 + 190).take(4).for_each(|texel| *texel = Vec3::splat(2000.0));
    for (model, sky, what) in [(&lit, None, "a lamp"), (&model, Some(&sky), "a sun")] {
        let (_, taken) = baked(model, sky, &camera, SETTINGS);
        let [found, wanted] = [mean(&taken), mean(&photograph(model, sky, &camera, 1024))];
        assert!((found / wanted - 1.0).abs().max_element() < 0.04, "{found}, not {wanted}, of {what}");
    }
}

/// A room with a lamp in its ceiling, a block that hides a part of the floor, a sheet of no thickness, a mirror and a ball of glass.
fn furnished() -> Model {
    let glass = Material { metallic: 0.0, roughness: 0.0, transmission: 1.0, volume: true, ..Material::default() };
    let mut model = ball(glass);
    model.vertices.iter_mut().for_each(|vertex| vertex.position = 0.3 * vertex.position + DVec3::new(-0.5, -0.6, 0.3));
    let mut wall = |place, u, v, colour: Vec3| {
        let material = Material { base: colour.extend(1.0), ..lambert(1.0) };
        add_quad(&mut model, place, u, v, material);
    };
    let white = Vec3::splat(0.7);
    wall(DVec3::NEG_Y, DVec3::Z, DVec3::X, white);
    wall(DVec3::Y, DVec3::X, DVec3::Z, white);
    wall(DVec3::NEG_Z, DVec3::X, DVec3::Y, white);
    wall(DVec3::NEG_X, DVec3::Y, DVec3::Z, Vec3::new(0.7, 0.1, 0.1));
    wall(DVec3::X, DVec3::Z, DVec3::Y, Vec3::new(0.1, 0.6, 0.1));
    // A table, of which both sides are seen.
    wall(DVec3::new(0.4, -0.4, -0.3), 0.3 * DVec3::Z, 0.3 * DVec3::X, Vec3::splat(0.5));
    let mirror = Material { metallic: 1.0, roughness: 0.0, ..Material::default() };
    add_quad(&mut model, DVec3::new(0.0, 0.0, -0.99), 0.3 * DVec3::X, 0.4 * DVec3::Y, mirror);
    let lamp = Material { emission: Vec3::splat(8.0), ..Material { double_sided: false, ..lambert(0.0) } };
    add_quad(&mut model, DVec3::new(0.0, 0.98, 0.0), 0.4 * DVec3::X, 0.4 * DVec3::Z, lamp);
    model
}

/// If this failed, photographs of rooms with a light map would show another light than paths from every pixel find, beyond the blur of
/// its cells: corners lie within a few of them.
#[test]
fn a_furnished_room_looks_as_traced_paths_say() {
    let model = furnished();
    let camera = camera(DVec3::new(0.1, 0.1, 2.6), DVec3::new(0.0, -0.1, 0.0), 48, 0.75);
    let settings = LightmapSettings { cells: 20_000, rays: 128, ..SETTINGS };
    let (_, taken) = baked(&model, None, &camera, settings);
    let traced = photograph(&model, None, &camera, 512);
    let errors = errors(&taken, &traced, 48);
    assert!(errors[72] < 0.03, "half of the blocks differ by {}", errors[72]);
    assert!(errors[129] < 0.1, "a tenth of the blocks differ by {}", errors[129]);
    let [found, wanted] = [mean(&taken), mean(&traced)];
    assert!((found / wanted - 1.0).abs().max_element() < 0.03, "{found}, not {wanted}");
}

/// If this failed, the same command would give other pictures each time, or a map that was kept other ones than a new one.
#[test]
fn the_same_seed_gives_the_same_bits_also_from_a_file() {
    let model = furnished();
    let camera = camera(DVec3::new(0.1, 0.1, 2.6), DVec3::ZERO, 16, 0.75);
    let settings = LightmapSettings { cells: 1000, rays: 32, ..SETTINGS };
    let (light, first) = baked(&model, None, &camera, settings);
    let (_, second) = baked(&model, None, &camera, settings);
    assert_eq!(first, second);
    let (_, other) = baked(&model, None, &camera, LightmapSettings { seed: 2, ..settings });
    assert_ne!(first, other);

    let folder = tempfile::tempdir().unwrap();
    let file: PathBuf = folder.path().join("light.map");
    let assembly = Assembly::new(&model, None).unwrap();
    let eyes = [camera.pose.position];
    light.write(&file, &assembly, &settings, &eyes).unwrap();
    let read = |settings: &LightmapSettings, eyes: &[DVec3]| LightMap::read(&file, &assembly, settings, eyes).unwrap();
    let kept = read(&settings, &eyes).expect("it is the same light");
    let tracer = Tracer::lit(&context(), &assembly, 256, &kept).unwrap();
    let exposure = Exposure { samples: 16, seed: 1, show_sky: true };
    assert_eq!(tracer.photograph(&camera, 0, exposure, || ControlFlow::Continue(())).unwrap(), first);

    assert!(read(&LightmapSettings { seed: 3, ..settings }, &eyes).is_none(), "another light was taken");
    assert!(read(&settings, &[DVec3::ONE]).is_none(), "light for other places was taken");
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    assert!(read(&settings, &eyes).is_none(), "a damaged map was taken");
}

/// If this failed, cells of a scene of many small triangles, or of one in the dark, would stop a bake or a picture.
#[test]
fn small_triangles_and_dark_scenes_are_baked() {
    let camera = camera(DVec3::new(0.0, 0.5, 2.0), DVec3::ZERO, 16, 0.6);
    let few = LightmapSettings { cells: 100, rays: 8, ..SETTINGS };
    let (light, taken) = baked(&samples::object_model(), Some(&samples::studio()), &camera, few);
    assert!(light.cells() >= 2 * samples::object_model().faces.len());
    assert!(taken.pixels.iter().all(|pixel| pixel.iter().all(|v| v.is_finite() && *v >= 0.0)));
    // Light that reaches nothing: a lamp that shines away from the only surface.
    let mut model = Model::default();
    add_quad(&mut model, DVec3::ZERO, DVec3::Z, DVec3::X, lambert(0.5));
    let lamp = Material { emission: Vec3::ONE, ..Material { double_sided: false, ..lambert(0.0) } };
    add_quad(&mut model, DVec3::new(0.0, -1.0, 0.0), DVec3::X, DVec3::Z, lamp);
    let (_, taken) = baked(&model, None, &camera, few);
    assert_eq!(mean(&taken), Vec3::ZERO);
}
