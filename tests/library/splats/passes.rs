//! The stages of Gaussian splatting against their twin in double precision.

use crate::support::device::{context, silent};
use crate::support::splats::{Pass, pass, photo, scene, twin_view, view};
use camsplat::Result;
use camsplat::scene::gaussians::Gaussians;
use camsplat::splats::render::frame::View;
use camsplat::splats::render::layout;
use camsplat::splats::render::wanted::{Threads, Wanted};
use camsplat::splats::twin;
use glam::DVec3;

const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];

/// A stored pixel over a background; none where it is unknown.
fn over(stored: u32, background: DVec3) -> Option<DVec3> {
    let [r, g, b, a] = stored.to_le_bytes().map(|v| f64::from(v) / 255.0);
    (stored != 0x00ff_ffff).then(|| background.lerp(DVec3::new(r, g, b), a))
}

/// Planes without gaps as the twin's splats.
fn unpacked(planes: &[f32], like: &Gaussians) -> Vec<twin::Splat> {
    twin::splats(&layout::from_planes(planes, like.degree, like.len(), like.len()))
}

/// Values of a splat in the order of the planes.
fn flat(splat: &twin::Splat) -> Vec<f64> {
    let mut values = splat.centre.to_array().to_vec();
    values.extend(splat.log_scale.to_array());
    values.extend(splat.rotation);
    values.push(splat.opacity);
    values.extend(splat.harmonics.iter().flat_map(|h| h.to_array()));
    values
}

/// Compares a pass on the device with the twin: picture, depth, loss, gradients.
fn compare(name: &str, gaussians: &Gaussians, view: View, antialiased: bool, pass: &Pass, photo: &[u32]) {
    let rules = twin::Rules { antialiased, ..twin::Rules::default() };
    let background = DVec3::from(BACKGROUND.map(f64::from));
    let (splats, camera) = (twin::splats(gaussians), twin_view(&view));
    let picture = twin::render(&splats, &camera, &rules, background);
    let mut wrong = 0;
    for (i, got) in pass.picture.iter().enumerate() {
        let colour = DVec3::new(got[0].into(), got[1].into(), got[2].into());
        let error = (colour - picture.colour[i]).abs().max_element();
        let others = (f64::from(got[3]) - picture.transmittance[i])
            .abs()
            .max((f64::from(pass.depths[i]) - picture.depth[i]).abs() / 10.0);
        if error.max(others) > 1e-4 {
            wrong += 1;
        }
    }
    // A cut-off decides in single precision now and then as it would not in double.
    assert!(wrong * 1000 <= pass.picture.len(), "{name}: {wrong} of {} pixels differ", pass.picture.len());

    let seen: Vec<DVec3> = pass.picture.iter().map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into())).collect();
    let target: Vec<Option<DVec3>> = photo.iter().map(|p| over(*p, background)).collect();
    let (loss, by_pixel) = twin::loss(&seen, &target, view.width as usize, view.height as usize);
    let got = pass.record.loss();
    assert!((got - loss).abs() < 1e-5, "{name}: the loss is {got}, not {loss}");
    let largest = by_pixel.iter().map(|g| g.abs().max_element()).fold(0.0, f64::max);
    for (i, (got, want)) in pass.by_pixel.iter().zip(&by_pixel).enumerate() {
        let got = DVec3::new(got[0].into(), got[1].into(), got[2].into());
        assert!((got - want).abs().max_element() < 1e-4 * largest, "{name}: pixel {i}: {got}, not {want}");
    }

    let want = twin::gradients(&splats, &camera, &rules, background, &by_pixel);
    let got = unpacked(&pass.gradients, gaussians);
    let count = layout::planes(gaussians.degree);
    let (mut got_planes, mut want_planes) = (vec![Vec::new(); count], vec![Vec::new(); count]);
    for (got, want) in got.iter().zip(&want) {
        flat(got).into_iter().enumerate().for_each(|(k, v)| got_planes[k].push(v));
        flat(want).into_iter().enumerate().for_each(|(k, v)| want_planes[k].push(v));
    }
    for (plane, (got, want)) in got_planes.iter().zip(&want_planes).enumerate() {
        let size = want.iter().map(|v| v * v).sum::<f64>().sqrt();
        let error = got.iter().zip(want).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        assert!(error <= 1e-4 * size + 1e-9, "{name}: plane {plane} is off by {error} of {size}");
    }
}

fn wanted(antialiased: bool) -> Wanted {
    Wanted { antialiased, depths: true, gradients: true, ..Wanted::default() }
}

/// Every gradient of the trainer comes from these stages: a wrong sign or factor still descends, only badly.
#[test]
fn stages_agree_with_the_twin_over_odd_scenes() -> Result<()> {
    let context = context();
    let cases = [
        ("one splat", 1, 0, 40, 24, false),
        ("odd size, degree 1", 60, 1, 37, 53, false),
        ("smaller than a tile", 40, 2, 9, 5, false),
        ("degree 3", 300, 3, 96, 64, false),
        ("antialiased", 300, 3, 64, 80, true),
        ("many", 3000, 0, 64, 64, false),
    ];
    for (seed, (name, count, degree, width, height, antialiased)) in cases.into_iter().enumerate() {
        let gaussians = scene(seed as u64, count, degree);
        let view = view(width, height);
        let photo = photo(seed as u64, &view);
        let mut pictures = Vec::new();
        // However a tile's pixels are divided among threads.
        for threads in [
            Threads::WIDE,
            Threads::NARROW,
            Threads { forward: 64, lanes: 32, loss: 64, ..Threads::NARROW },
            Threads { forward: 256, ..Threads::NARROW },
        ] {
            let wanted = Wanted { threads: Some(threads), ..wanted(antialiased) };
            let pass = pass(&context, &gaussians, view, &photo, BACKGROUND, wanted, 1 << 17)?;
            compare(&format!("{name}, {threads:?}"), &gaussians, view, antialiased, &pass, &photo);
            pictures.push((pass.picture, pass.by_pixel));
        }
        // Elsewhere compilers may contract what is unrolled otherwise.
        if context.physical().is_cpu() {
            let alike = pictures.iter().all(|picture| *picture == pictures[0]);
            assert!(alike, "{name}: the threads show in the picture or in the loss");
        }
    }
    silent(&context);
    Ok(())
}

/// If this failed, a number of threads that a stage was not written for would silently give wrong gradients.
#[test]
fn a_tile_is_divided_only_as_stages_were_written() {
    let wrong = [
        Threads { lanes: 64, ..Threads::WIDE },
        Threads { lanes: 16, ..Threads::NARROW },
        Threads { forward: 16, ..Threads::WIDE },
        Threads { loss: 8, ..Threads::NARROW },
        Threads { forward: 512, ..Threads::WIDE },
        Threads { squares: 48, ..Threads::NARROW },
    ];
    assert!(wrong.iter().all(|threads| threads.check().is_err()));
    assert!([Threads::WIDE, Threads::NARROW].iter().all(|threads| threads.check().is_ok()));
}

/// The fast mode must differ in the order of its sums alone.
#[test]
fn the_fast_way_sums_the_same() -> Result<()> {
    let context = context();
    if !context.physical().atomic_floats {
        eprintln!("skipped: {} adds no floats atomically", context.physical().name);
        return Ok(());
    }
    let (gaussians, view) = (scene(7, 500, 1), view(70, 50));
    let photo = photo(7, &view);
    for threads in [Threads::WIDE, Threads::NARROW].map(Some) {
        let wanted = Wanted { fast: true, threads, ..wanted(true) };
        let pass = pass(&context, &gaussians, view, &photo, BACKGROUND, wanted, 1 << 17)?;
        compare("fast", &gaussians, view, true, &pass, &photo);
    }
    silent(&context);
    Ok(())
}

/// On lavapipe all loops of one invocation together end silently after 65,535 iterations, and lists of tiles are cut into blocks:
/// what lies behind either bound must count like the rest.
#[test]
fn a_tile_takes_more_splats_than_a_loop_may_have_rounds() -> Result<()> {
    let context = context();
    let count = 100_000;
    let faint = Gaussians {
        // All in the middle of one pixel, one behind the other, the last one red and dense.
        centres: (0..count)
            .map(|i| DVec3::new(0.5, 0.5, 40.0) / 40.0 * (1.0 + f64::from(i) * 1e-6) * 3.0 - DVec3::Z * 3.0)
            .collect(),
        log_scales: (0..count).map(|i| if i + 1 == count { [-0.5; 3] } else { [-3.0; 3] }).collect(),
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; count as usize],
        // Just bright enough for that pixel: soon no light is left there, and those of the whole tile go on.
        opacities: (0..count).map(|i| if i + 1 == count { 4.0 } else { -5.52 }).collect(),
        degree: 0,
        harmonics: (0..count).flat_map(|i| if i + 1 == count { [1.7, -1.7, -1.7] } else { [0.0; 3] }).collect(),
        antialiased: false,
    };
    let view = View {
        row_x: [1.0, 0.0, 0.0, 0.0],
        row_y: [0.0, 1.0, 0.0, 0.0],
        row_z: [0.0, 0.0, 1.0, 3.0],
        position: [0.0, 0.0, -3.0],
        near: 0.01,
        focal: [40.0; 2],
        principal: [8.0; 2],
        width: 16,
        height: 16,
        ..View::default()
    };
    let photo = photo(1, &view);
    for threads in [Threads::WIDE, Threads::NARROW].map(Some) {
        let pass = pass(&context, &faint, view, &photo, [0.0; 3], Wanted { threads, ..wanted(false) }, 1 << 17)?;
        assert_eq!(pass.instances, count, "every splat is on the one tile");
        let red = pass.picture.iter().map(|pixel| pixel[0]).fold(0.0, f32::max);
        assert!(red > 0.9, "{threads:?}: the last splat is not seen: {red}");
        let by_red = pass.gradients[11 * count as usize..][..count as usize].last();
        assert!(by_red.is_some_and(|g| *g != 0.0), "the last splat has no gradient");
    }
    silent(&context);
    Ok(())
}

/// If this failed, a model that dies during training, or a view into nothing, would end in rubbish.
#[test]
fn nothing_to_see_is_the_background() -> Result<()> {
    let context = context();
    let view = view(33, 21);
    let photo = photo(3, &view);
    let mut behind = scene(3, 40, 0);
    behind.centres.iter_mut().for_each(|centre| *centre -= 100.0 * DVec3::from(view.position.map(f64::from)));
    behind.centres.iter_mut().for_each(|centre| *centre = -*centre);
    let broken = Gaussians { rotations: vec![[0.0; 4]; 40], opacities: vec![f32::NAN; 40], ..scene(3, 40, 0) };
    for (name, gaussians) in [("none", Gaussians::default()), ("behind", behind), ("broken", broken)] {
        let pass = pass(&context, &gaussians, view, &photo, BACKGROUND, wanted(false), 1 << 12)?;
        assert_eq!(pass.instances, 0, "{name}");
        let is_background = |p: &[f32; 4]| *p == [BACKGROUND[0], BACKGROUND[1], BACKGROUND[2], 1.0];
        assert!(pass.picture.iter().all(is_background), "{name}: {:?}", pass.picture[0]);
        let shapes = pass.gradients.len() / layout::planes(0) * layout::OPACITY;
        assert!(pass.gradients[..shapes].iter().all(|g| *g == 0.0), "{name}");
    }
    silent(&context);
    Ok(())
}
