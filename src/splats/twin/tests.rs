//! Pictures and gradients of the twin against closed forms and differences.

use glam::DQuat;

use super::*;
use crate::scene::random::uniforms;

/// A camera that is turned, off the origin, with a lens that is the same along neither axis.
fn view() -> View {
    let rotation = DMat3::from_quat(DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(-0.7));
    View {
        rotation,
        translation: DVec3::new(0.3, -0.2, 0.5),
        focal: [21.0, 24.0],
        principal: [11.7, 8.1],
        width: 23,
        height: 17,
        near: 0.2,
    }
}

/// The camera at the origin, looking along z at a picture of so many pixels a side.
fn plain_view(size: u32) -> View {
    let middle = 0.5 * f64::from(size);
    View {
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
        focal: [20.0; 2],
        principal: [middle; 2],
        width: size,
        height: size,
        near: 0.2,
    }
}

/// The point of the world that `view` sees at a pixel and a depth.
fn seen_at(view: &View, pixel: [f64; 2], depth: f64) -> DVec3 {
    let ray = |axis: usize| (pixel[axis] - view.principal[axis]) / view.focal[axis];
    view.rotation.transpose() * (depth * DVec3::new(ray(0), ray(1), 1.0) - view.translation)
}

/// What a scene covers: the range of each value that is drawn.
#[derive(Clone, Copy)]
struct Kind {
    /// Means in the picture, in parts of its size.
    means: [f64; 2],
    log_scales: [[f64; 2]; 3],
    opacities: [f64; 2],
    degree: u32,
}

const KIND: Kind = Kind { means: [0.1, 0.9], log_scales: [[-2.5, -0.5]; 3], opacities: [-2.0, 2.0], degree: 1 };

/// Splats of a kind, keyed by a seed.
fn scene(seed: u64, count: u32, kind: Kind, view: &View) -> Vec<Splat> {
    let draw = |stream: u32, i: u32| uniforms(seed, stream, i);
    let within = |[from, to]: [f64; 2], u: f64| from + u * (to - from);
    (0..count)
        .map(|i| {
            let [u, v, depth, opacity] = draw(0, i);
            let scales = draw(1, i);
            let size = [f64::from(view.width), f64::from(view.height)];
            Splat {
                centre: seen_at(
                    view,
                    [within(kind.means, u) * size[0], within(kind.means, v) * size[1]],
                    1.0 + 4.0 * depth,
                ),
                log_scale: DVec3::from_array(std::array::from_fn(|k| within(kind.log_scales[k], scales[k]))),
                // Lengths other than 1.
                rotation: draw(2, i).map(|u| 3.0 * (u - 0.5)),
                opacity: within(kind.opacities, opacity),
                harmonics: (0..(kind.degree + 1) * (kind.degree + 1))
                    .map(|k| DVec3::from_slice(&draw(3 + k, i).map(|u| 1.2 * (u - 0.5))[..3]))
                    .collect(),
            }
        })
        .collect()
}

/// All values of a splat, one after the other.
fn values(splat: &mut Splat) -> Vec<&mut f64> {
    let Splat { centre, log_scale, rotation, opacity, harmonics } = splat;
    let vectors = [centre, log_scale].into_iter().flat_map(components);
    vectors.chain(rotation.iter_mut()).chain([opacity]).chain(harmonics.iter_mut().flat_map(components)).collect()
}

fn components(vector: &mut DVec3) -> impl Iterator<Item = &mut f64> {
    let DVec3 { x, y, z } = vector;
    [x, y, z].into_iter()
}

/// A weight for every pixel and channel: the gradient of the function whose differences are taken.
fn weights(view: &View) -> Vec<DVec3> {
    (0..view.pixels() as u32).map(|i| DVec3::from_slice(&uniforms(99, 0, i).map(|u| u - 0.3)[..3])).collect()
}

const BACKGROUND: DVec3 = DVec3::new(0.2, 0.5, 0.9);

fn weighed(splats: &[Splat], view: &View, rules: &Rules) -> f64 {
    let picture = render(splats, view, rules, BACKGROUND);
    picture.colour.iter().zip(weights(view)).map(|(c, w)| c.dot(w)).sum()
}

/// Calls `check` with the splat, the index of the value in it, its gradient, and the function of a change of that value.
fn each_value(
    splats: &[Splat],
    view: &View,
    rules: &Rules,
    mut check: impl FnMut(usize, usize, f64, &mut dyn FnMut(f64) -> f64),
) {
    let mut gradients = gradients(splats, view, rules, BACKGROUND, &weights(view));
    let mut changed = splats.to_vec();
    for (i, gradient) in gradients.iter_mut().enumerate() {
        for (k, g) in values(gradient).into_iter().map(|g| *g).enumerate() {
            let start = *values(&mut changed[i])[k];
            let mut at = |change: f64| {
                *values(&mut changed[i])[k] = start + change;
                let value = weighed(&changed, view, rules);
                *values(&mut changed[i])[k] = start;
                value
            };
            check(i, k, g, &mut at);
        }
    }
}

/// Compares all gradients of a scene with differences of fourth order.
fn hold(name: &str, splats: &[Splat], view: &View, rules: &Rules) {
    let mut largest = 0.0f64;
    // The function is about 100, of which 1e-14 is rounding, and is divided by h.
    let (h, rounding) = (1e-4, 1e-8);
    each_value(splats, view, rules, |i, k, gradient, at| {
        let difference = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        let error = (gradient - difference).abs();
        assert!(
            error <= 1e-6 * difference.abs() + rounding,
            "{name}: splat {i}, value {k}: {gradient} against {difference}"
        );
        largest = largest.max(difference.abs());
    });
    assert!(largest > 1e-3, "{name}: nothing was seen");
}

/// Scenes of all kinds, those among them that trainers are known to get wrong, each by both rules.
fn each_kind(mut check: impl FnMut(&str, &[Splat], &Rules)) {
    let (thin, wide) = ([-14.0, -12.0], [-1.5, -0.5]);
    let kinds = [
        ("plain", KIND),
        ("edge", Kind { means: [-0.05, 0.05], ..KIND }),
        ("far edge", Kind { means: [0.95, 1.05], ..KIND }),
        ("larger than the picture", Kind { log_scales: [[1.0, 2.5]; 3], ..KIND }),
        ("clamped low", Kind { means: [-0.6, -0.2], log_scales: [[-1.0, 0.5]; 3], ..KIND }),
        ("clamped high", Kind { means: [1.2, 1.6], log_scales: [[-1.0, 0.5]; 3], ..KIND }),
        ("flat", Kind { log_scales: [wide, thin, wide], ..KIND }),
        ("needles", Kind { log_scales: [[-7.0, -6.0], [-7.0, -6.0], wide], ..KIND }),
        ("specks", Kind { log_scales: [[-6.0, -4.0]; 3], ..KIND }),
        ("all but clear", Kind { opacities: [-12.0, -8.0], ..KIND }),
        ("all but opaque", Kind { opacities: [8.0, 12.0], ..KIND }),
        ("degree 0", Kind { degree: 0, ..KIND }),
        ("degree 2", Kind { degree: 2, ..KIND }),
        ("degree 3", Kind { degree: 3, ..KIND }),
    ];
    for (seed, (name, kind)) in kinds.into_iter().enumerate() {
        for antialiased in [false, true] {
            let rules = Rules { antialiased, ..Rules::smooth() };
            // Nearly transparent splats show next to nothing, whatever their gradients.
            let mut splats = scene(seed as u64, 8, kind, &view());
            if name == "all but clear" {
                splats.extend(scene(50, 2, KIND, &view()));
            }
            check(&format!("{name}, antialiased {antialiased}"), &splats, &rules);
        }
    }
}

/// If this failed, training would not descend.
#[test]
fn gradients_are_those_of_differences() {
    each_kind(|name, splats, rules| hold(name, splats, &view(), rules));
}

/// If this failed, poses would be corrected along another slope than the loss has: cameras would still come to rest, in wrong places.
#[test]
fn the_gradient_by_the_pose_is_that_of_differences() {
    let view = view();
    each_kind(|name, splats, rules| {
        let value = |turn: DVec3, shift: DVec3| {
            let rotation = view.rotation * DMat3::from_quat(DQuat::from_scaled_axis(-turn));
            let moved = View { rotation, translation: -(rotation * (view.centre() + shift)), ..view };
            weighed(splats, &moved, rules)
        };
        let found = by_pose(splats, &view, rules, BACKGROUND, &weights(&view));
        let mut largest = 0.0f64;
        for (of, found) in found.into_iter().enumerate() {
            for axis in 0..3 {
                let at = |by: f64| {
                    let mut moved = [DVec3::ZERO; 2];
                    moved[of][axis] = by;
                    value(moved[0], moved[1])
                };
                let h = 1e-4;
                let known = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                let (error, what) = ((found[axis] - known).abs(), ["turn", "shift"][of]);
                assert!(error <= 1e-6 * known.abs() + 1e-7, "{name}: {what} {axis}: {} for {known}", found[axis]);
                largest = largest.max(known.abs());
            }
        }
        assert!(largest > 1e-2, "{name}: nothing was seen");
    });
}

/// If this failed, the backward pass would stop, skip or cap elsewhere than the picture did.
#[test]
fn gradients_keep_to_the_hard_decisions_of_the_picture() {
    for (seed, opacities) in [(1, [-5.0, -2.0]), (2, [3.0, 9.0])] {
        let splats = scene(seed, 14, Kind { log_scales: [[-1.5, 0.5]; 3], opacities, ..KIND }, &view());
        let (mut held, mut passed_over) = (0, 0);
        each_value(&splats, &view(), &Rules::default(), |i, k, gradient, at| {
            let h = 1e-6;
            let (below, here, above) = (at(-h), at(0.0), at(h));
            // A decision fell otherwise between the three: the function jumps and has no difference.
            if (above - 2.0 * here + below).abs() > 1e-9 {
                passed_over += 1;
                return;
            }
            held += 1;
            let difference = (above - below) / (2.0 * h);
            let error = (gradient - difference).abs();
            assert!(error <= 1e-5 * difference.abs() + 1e-6, "splat {i}, value {k}: {gradient} against {difference}");
        });
        assert!(held > 9 * passed_over, "{held} held, {passed_over} passed over");
        let differs = |rules: Rules| {
            let picture = |rules| render(&splats, &view(), &rules, BACKGROUND);
            picture(rules) != picture(Rules::default())
        };
        // Each rule must have taken effect where it was meant to.
        match seed {
            1 => assert!(differs(Rules { least_alpha: 0.0, ..Rules::default() })),
            _ => {
                assert!(differs(Rules { most_alpha: 1.0, ..Rules::default() }));
                assert!(differs(Rules { least_transmittance: 0.0, ..Rules::default() }));
            }
        }
    }
}

/// If this failed, densification would add splats in the wrong places: the gradient must be that of moving the mean alone.
#[test]
fn the_gradient_by_the_mean_is_that_of_a_shift_in_the_picture() {
    let (view, rules) = (view(), Rules::smooth());
    let splats = scene(3, 6, KIND, &view);
    let (_, means) = gradients_and_means(&splats, &view, &rules, BACKGROUND, &weights(&view));
    let projected = project_all(&splats, &view, &rules);
    for (i, by_mean) in means.into_iter().enumerate() {
        for (axis, found) in by_mean.to_array().into_iter().enumerate() {
            let shifted = |by: f64| {
                let mut projected = projected.clone();
                projected[i].as_mut().unwrap().mean[axis] += by;
                let picture = composite::forward(&projected, &view, &rules, BACKGROUND);
                picture.colour.iter().zip(weights(&view)).map(|(c, w)| c.dot(w)).sum::<f64>()
            };
            let difference = (shifted(1e-4) - shifted(-1e-4)) / 2e-4;
            assert!((found - difference).abs() < 1e-6, "splat {i}: {found} for {difference}");
        }
    }
}

fn ball(centre: DVec3, colour: DVec3, opacity: f64) -> Splat {
    Splat {
        centre,
        log_scale: DVec3::splat(0.1f64.ln()),
        rotation: [1.0, 0.0, 0.0, 0.0],
        opacity: (opacity / (1.0 - opacity)).ln(),
        harmonics: vec![(colour - 0.5) / 0.282_094_791_773_878_14],
    }
}

/// If this failed, a single splat would have another size, place, colour or opacity than the formulas give.
#[test]
fn one_splat_is_what_its_closed_form_says() {
    let view = plain_view(9);
    let (red, white) = (DVec3::new(0.8, 0.1, 0.1), DVec3::ONE);
    // The mean is at (5.5, 4.5): f x / z = 1.
    let splat = ball(DVec3::new(0.1, 0.0, 2.0), red, 0.6);
    let picture = render(std::slice::from_ref(&splat), &view, &Rules::default(), white);
    // x: (20 * 0.1 / 2)^2 (1 + a^2) with the ray's slope a = 0.05; y: without it.
    let (xx, yy) = (1.0 + 0.05 * 0.05 + 0.3, 1.3);
    for (i, j) in [(5usize, 4usize), (7, 4), (4, 5)] {
        let (dx, dy) = (i as f64 - 5.0, j as f64 - 4.0);
        let alpha = 0.6 * (-0.5 * (dx * dx / xx + dy * dy / yy)).exp();
        let at = j * 9 + i;
        assert!((picture.colour[at] - (alpha * red + (1.0 - alpha) * white)).length() < 1e-12, "pixel {i} {j}");
        assert!((picture.transmittance[at] - (1.0 - alpha)).abs() < 1e-12);
        assert!((picture.depth[at] - alpha * 2.0).abs() < 1e-12);
    }
    // 0.6 exp(-sigma) at the corner is less than 1/255.
    assert_eq!((picture.colour[8 * 9], picture.transmittance[8 * 9]), (white, 1.0));
    // Mip-Splatting's filter is narrower, 0.1, and takes from the opacity what it adds to the area.
    let made_up = project::project(&splat, &view, &Rules { antialiased: true, ..Rules::default() }).unwrap();
    let (xx, yy): (f64, f64) = (1.0 + 0.05 * 0.05, 1.0);
    let expected = 0.6 * (xx / (xx + 0.1) * (yy / (yy + 0.1))).sqrt();
    assert!((made_up.covariance[0] - xx - 0.1).abs() < 1e-12 && (made_up.covariance[2] - yy - 0.1).abs() < 1e-12);
    assert!((made_up.opacity - expected).abs() < 1e-12, "{} for {expected}", made_up.opacity);
}

/// If this failed, rotations would be read in another order or inverted, or perspective would bend splats wrongly.
#[test]
fn the_covariance_is_that_of_the_projected_gaussian() {
    let view = view();
    for splat in scene(4, 20, KIND, &view) {
        let [w, x, y, z] = splat.rotation;
        let axes = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let pixel = |point: DVec3| {
            let p = view.rotation * point + view.translation;
            DVec2::new(view.focal[0] * p.x / p.z + view.principal[0], view.focal[1] * p.y / p.z + view.principal[1])
        };
        // The means of a step of one deviation along each axis, to first order.
        let mut covariance = [0.3, 0.0, 0.3];
        for k in 0..3 {
            let step = 1e-6 * axes.col(k);
            let moved = splat.log_scale[k].exp() * (pixel(splat.centre + step) - pixel(splat.centre - step)) / 2e-6;
            [moved.x * moved.x, moved.x * moved.y, moved.y * moved.y]
                .iter()
                .zip(&mut covariance)
                .for_each(|(v, sum)| *sum += v);
        }
        let found = project::project(&splat, &view, &Rules::smooth()).unwrap();
        assert!((found.mean - pixel(splat.centre)).length() < 1e-12);
        for k in 0..3 {
            assert!((found.covariance[k] - covariance[k]).abs() < 1e-6 * (covariance[0] + covariance[2]));
        }
        let ([a, b, c], [xx, xy, yy]) = (found.conic, found.covariance);
        for (product, one) in [(a * xx + b * xy, 1.0), (a * xy + b * yy, 0.0), (b * xy + c * yy, 1.0)] {
            assert!((product - one).abs() < 1e-9, "the conic is no inverse");
        }
    }
}

/// If this failed, colours would turn the wrong way as the camera moves.
#[test]
fn harmonics_are_taken_from_the_camera_to_the_splat() {
    let mut splat = ball(DVec3::new(0.0, 0.0, 2.0), DVec3::splat(0.5), 0.9);
    splat.harmonics.extend([DVec3::ZERO, DVec3::X, DVec3::ZERO]);
    let from = |view: &View| project::project(&splat, view, &Rules::default()).unwrap().colour;
    let front = plain_view(9);
    assert!((from(&front) - DVec3::new(0.5 + 0.488_602_511_9, 0.5, 0.5)).length() < 1e-9);
    let rotation = DMat3::from_rotation_y(std::f64::consts::PI);
    let behind = View { rotation, translation: -(rotation * DVec3::new(0.0, 0.0, 5.0)), ..front };
    assert!((from(&behind) - DVec3::new(0.5 - 0.488_602_511_9, 0.5, 0.5)).length() < 1e-9);
}

/// If this failed, something would be drawn where there is nothing to see, or a picture would not be its background.
#[test]
fn what_cannot_be_seen_leaves_the_background() {
    let view = plain_view(5);
    let empty = Picture { colour: vec![BACKGROUND; 25], transmittance: vec![1.0; 25], depth: vec![0.0; 25] };
    let colour = DVec3::ONE;
    let cases = [
        vec![],
        vec![ball(DVec3::new(0.0, 0.0, -2.0), colour, 0.9)],
        vec![ball(DVec3::new(0.0, 0.0, 0.19), colour, 0.9)],
        vec![ball(DVec3::new(0.0, 0.0, 2.0), colour, 0.0039)],
        vec![ball(DVec3::new(50.0, 0.0, 2.0), colour, 0.9)],
    ];
    for splats in cases {
        assert_eq!(render(&splats, &view, &Rules::default(), BACKGROUND), empty);
        for gradient in gradients(&splats, &view, &Rules::default(), BACKGROUND, &[DVec3::ONE; 25]) {
            assert_eq!(gradient, Splat::zero(1));
        }
    }
}

/// If this failed, what is behind would shine through what is in front, or equal depths would be drawn at random.
#[test]
fn the_nearer_splat_hides_the_farther_one() {
    let view = plain_view(5);
    let (red, blue) = (DVec3::X, DVec3::Z);
    let (near, far) = (ball(DVec3::new(0.0, 0.0, 2.0), red, 0.8), ball(DVec3::new(0.0, 0.0, 3.0), blue, 0.8));
    let middle = |splats: &[Splat]| render(splats, &view, &Rules::default(), DVec3::ZERO).colour[12];
    let expected = DVec3::new(0.8, 0.0, 0.2 * 0.8);
    assert!((middle(&[near.clone(), far.clone()]) - expected).length() < 1e-12);
    assert!((middle(&[far.clone(), near.clone()]) - expected).length() < 1e-12);
    let level = Splat { centre: near.centre, ..far };
    assert!((middle(&[near.clone(), level.clone()]) - expected).length() < 1e-12);
    assert!((middle(&[level, near]) - DVec3::new(0.16, 0.0, 0.8)).length() < 1e-12);
}

/// If this failed, pixels would end one splat too early or too late, and the cap of alpha would not hold.
#[test]
fn a_pixel_ends_before_the_splat_that_would_leave_too_little() {
    let view = plain_view(5);
    let splat = |depth: f64, colour: DVec3, opacity: f64| ball(DVec3::new(0.0, 0.0, depth), colour, opacity);
    let all = [
        splat(2.0, DVec3::X, 0.999_999),
        // Leaves 0.01 * 0.05, after which the third would leave 0.00005 and the last 0.00045.
        splat(3.0, DVec3::Y, 0.95),
        splat(4.0, DVec3::Z, 0.9),
        splat(5.0, DVec3::ONE, 0.1),
    ];
    let middle = |count: usize| {
        let picture = render(&all[..count], &view, &Rules::default(), DVec3::ZERO);
        (picture.colour[12], picture.transmittance[12])
    };
    for (count, expected, left) in [(1, DVec3::new(0.99, 0.0, 0.0), 0.01), (2, DVec3::new(0.99, 0.0095, 0.0), 0.0005)] {
        let (colour, transmittance) = middle(count);
        assert!((colour - expected).length() < 1e-12, "{colour} after {count}");
        assert!((transmittance - left).abs() < 1e-12, "{transmittance} after {count}");
    }
    assert_eq!(middle(3), middle(2));
    assert_eq!(middle(4), middle(2));
}

/// If this failed, tiles would lose splats at their borders: a picture must not depend on how it is cut.
#[test]
fn tiles_lose_nothing() {
    let view = View { width: 70, height: 53, principal: [33.0, 28.0], focal: [60.0, 55.0], ..view() };
    let splats = scene(6, 200, Kind { means: [-0.2, 1.2], ..KIND }, &view);
    let rules = Rules::default();
    let picture = render(&splats, &view, &rules, BACKGROUND);
    for (i, j) in [(0u32, 0u32), (15, 15), (16, 16), (47, 31), (48, 32), (69, 52)] {
        // The same pixel in a picture of its own, of the same projected splats.
        let mut projected = project_all(&splats, &view, &rules);
        let shift = DVec2::new(f64::from(i), f64::from(j));
        projected.iter_mut().flatten().for_each(|splat| splat.mean -= shift);
        let single = composite::forward(&projected, &View { width: 1, height: 1, ..view }, &rules, BACKGROUND);
        let at = (j * 70 + i) as usize;
        assert!((single.colour[0] - picture.colour[at]).length() < 1e-12, "pixel {i} {j}");
        assert!((single.depth[0] - picture.depth[at]).abs() < 1e-12, "pixel {i} {j}");
    }
}

/// If this failed, values of a file would end up with another splat, axis or channel.
#[test]
fn the_values_of_a_file_keep_their_places() {
    let gaussians = Gaussians {
        centres: vec![DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)],
        log_scales: vec![[0.0; 3], [-1.0, -2.0, -3.0]],
        rotations: vec![[1.0, 0.0, 0.0, 0.0], [0.5, 1.5, 2.5, 3.5]],
        opacities: vec![0.0, 4.0],
        degree: 1,
        harmonics: (0..24).map(|v| v as f32).collect(),
        antialiased: false,
    };
    let expected = Splat {
        centre: DVec3::new(1.0, 2.0, 3.0),
        log_scale: DVec3::new(-1.0, -2.0, -3.0),
        rotation: [0.5, 1.5, 2.5, 3.5],
        opacity: 4.0,
        harmonics: (4..8).map(|k| 3.0 * f64::from(k) + DVec3::new(0.0, 1.0, 2.0)).collect(),
    };
    assert_eq!(splats(&gaussians)[1], expected);
}
