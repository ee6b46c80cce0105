//! The stages of Gaussian splatting against their twin in double precision.

mod gaussian_support;

use camsplat::Result;
use camsplat::gaussians::frame::View;
use camsplat::gaussians::layout;
use camsplat::gaussians::twin;
use camsplat::scene::gaussians::Gaussians;
use gaussian_support::{Pass, context, pass, photo, scene, silent, twin_view, view};
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

/// Holds a pass on the device against the twin: picture, depth, loss, gradients.
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

/// Every gradient of the trainer comes from these stages: a wrong sign or factor still descends, only badly.
#[test]
fn stages_agree_with_the_twin_over_odd_scenes() -> Result<()> {
    let context = context()?;
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
        let pass = pass(&context, &gaussians, view, &photo, BACKGROUND, antialiased, 1 << 17)?;
        compare(name, &gaussians, view, antialiased, &pass, &photo);
    }
    silent(&context);
    Ok(())
}
