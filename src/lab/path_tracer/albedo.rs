//! Tables of what the lobes reflect in all (directional albedo), by which they are raised and layers dimmed: twins of the
//! lobes of `shaders/glsl/lab/path_tracer/microfacet.glsl`, summed over the hemisphere.
//!
//! A table has [`SIDE`] columns over the root of the cosine and as many rows over roughness (the root of alpha), at even
//! steps from 0 to 1.

use std::f32::consts::{PI, TAU};
use std::sync::OnceLock;

use glam::{Vec2, Vec3};

use crate::engine::parallel::in_parallel;
use crate::engine::vulkan::shaders::glsl::lab::path_tracer::microfacet;
use crate::engine::vulkan::shaders::glsl::lab::path_tracer::surface;

/// Columns and rows of a table.
pub const SIDE: usize = microfacet::TABLE as usize;
/// Least width of microfacets' slopes, and of sheen's, as in the shader.
const MIN_ALPHA: f32 = surface::MIN_ALPHA as f32;
const MIN_SHEEN_ALPHA: f32 = surface::MIN_SHEEN_ALPHA as f32;
/// Samples along each of two axes.
const STEPS: u32 = 32;

/// Values of a table; `of` takes a direction's cosine and alpha.
fn table(of: impl Fn(f32, f32) -> f32 + Sync) -> Vec<f32> {
    let mut values = vec![0.0; SIDE * SIDE];
    in_parallel(&mut values, SIDE, |row, values| {
        let alpha = (row as f32 / (SIDE - 1) as f32).powi(2);
        for (column, value) in values.iter_mut().enumerate() {
            // The last table entry before grazing is used for grazing itself, where lobes have no value.
            let z = (column as f32 / (SIDE - 1) as f32).powi(2).max(1e-4);
            *value = of(z, alpha);
        }
    });
    values
}

/// Mean over a grid of pairs in [0, 1).
fn mean(of: impl Fn(Vec2) -> f32) -> f32 {
    let step = |i: u32| (i as f32 + 0.5) / STEPS as f32;
    let sum: f32 = (0..STEPS * STEPS).map(|i| of(Vec2::new(step(i % STEPS), step(i / STEPS)))).sum();
    sum / (STEPS * STEPS) as f32
}

/// Smith's share of microfacets that are seen from a direction.
fn smith(z: f32, alpha: f32) -> f32 {
    2.0 * z / (z + (alpha * alpha + (1.0 - alpha * alpha) * z * z).sqrt())
}

/// Share of those seen from `z` that are seen from `other` too; height-correlated.
fn also_seen(z: f32, other: f32, alpha: f32) -> f32 {
    let lambda = |z: f32| 0.5 * ((1.0 + alpha * alpha * (1.0 / (z * z) - 1.0)).sqrt() - 1.0);
    (1.0 + lambda(z)) / (1.0 + lambda(z) + lambda(other))
}

/// A microfacet's normal among those seen from `o`.
fn sample_facet(o: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let wide = Vec3::new(alpha * o.x, alpha * o.y, o.z).normalize();
    let z = (1.0 - u.y) * (1.0 + wide.z) - wide.z;
    let s = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let h = Vec3::new(s * (TAU * u.x).cos(), s * (TAU * u.x).sin(), z) + wide;
    Vec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize()
}

/// Reflection at a smooth dielectric; `eta` is the index beyond over the one on this side.
pub fn fresnel(cosine: f32, eta: f32) -> f32 {
    let beyond = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
    if beyond <= 0.0 {
        return 1.0;
    }
    let t = beyond.sqrt();
    let (s, p) = ((cosine - eta * t) / (cosine + eta * t), (eta * cosine - t) / (eta * cosine + t));
    0.5 * (s * s + p * p)
}

/// The tables of GGX, of which the albedo for `f0` and `f90` in Schlick's form is `f0` times the first plus `f90` times the
/// second, and of sheen. They are the same for all scenes, and computed once.
pub fn common() -> &'static [f32] {
    static TABLES: OnceLock<Vec<f32>> = OnceLock::new();
    // Not within `get_or_init`: a thread that waits for the rows of the tables may take other work meanwhile, which wants them too.
    TABLES.get().unwrap_or_else(|| {
        let tables = ggx_and_sheen();
        TABLES.get_or_init(|| tables)
    })
}

fn ggx_and_sheen() -> Vec<f32> {
    let split = |grazing: bool| {
        table(move |z, alpha| {
            let alpha = alpha.max(MIN_ALPHA);
            let o = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
            mean(|u| {
                let h = sample_facet(o, alpha, u);
                let i = 2.0 * o.dot(h) * h - o;
                let share = if i.z > 0.0 { also_seen(z, i.z, alpha) } else { 0.0 };
                let schlick = (1.0 - o.dot(h)).clamp(0.0, 1.0).powi(5);
                share * if grazing { schlick } else { 1.0 - schlick }
            })
        })
    };
    let mut tables = split(false);
    tables.extend(split(true));
    tables.extend(table(|z, alpha| {
        let alpha = alpha.max(MIN_SHEEN_ALPHA);
        let o = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
        // Cosines of the light are squares, to look closer at grazing light; half of the circle mirrors the other.
        mean(|u| {
            let iz = u.x * u.x;
            let turn = PI * u.y;
            let r = (1.0 - iz * iz).sqrt();
            let i = Vec3::new(r * turn.cos(), r * turn.sin(), iz);
            TAU * 2.0 * u.x * sheen(o, i, alpha) * iz
        })
        .min(1.0)
    }));
    tables
}

/// The tables of an interface to a body of index `ior`: seen from outside, and from within.
pub fn glass(ior: f32) -> Vec<f32> {
    let of = |eta: f32| {
        table(move |z, alpha| {
            let alpha = alpha.max(MIN_ALPHA);
            let o = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
            mean(|u| {
                let h = sample_facet(o, alpha, u);
                let cosine = o.dot(h);
                let reflected = fresnel(cosine, eta);
                let i = 2.0 * cosine * h - o;
                let back = if i.z > 0.0 { reflected * also_seen(z, i.z, alpha) } else { 0.0 };
                let beyond = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
                let through = (cosine / eta - beyond.max(0.0).sqrt()) * h - o / eta;
                let on = if through.z < 0.0 { (1.0 - reflected) * smith(-through.z, alpha) } else { 0.0 };
                back + on
            })
        })
    };
    let mut tables = of(ior);
    tables.extend(of(1.0 / ior));
    tables
}

fn sheen_curve(x: f32, alpha: f32) -> f32 {
    let q = (1.0 - alpha) * (1.0 - alpha);
    let between = |a: f32, b: f32| a + q * (b - a);
    let a = between(21.5473, 25.3245);
    let b = between(3.82987, 3.32435);
    let c = between(0.19823, 0.16801);
    let d = between(-1.97760, -1.27393);
    let e = between(-4.32054, -4.85967);
    a / (1.0 + b * x.powf(c)) + d * x + e
}

fn sheen_lambda(z: f32, alpha: f32) -> f32 {
    let power =
        if z < 0.5 { sheen_curve(z, alpha) } else { 2.0 * sheen_curve(0.5, alpha) - sheen_curve(1.0 - z, alpha) };
    power.exp()
}

/// Reflection of white cloth.
fn sheen(o: Vec3, i: Vec3, alpha: f32) -> f32 {
    let h = (o + i).normalize();
    let sine = h.x.hypot(h.y);
    let d = (2.0 + 1.0 / alpha) * sine.powf(1.0 / alpha) / TAU;
    d / ((1.0 + sheen_lambda(o.z, alpha) + sheen_lambda(i.z, alpha)) * 4.0 * o.z * i.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, reflections would be raised or layers dimmed by the wrong amount. A mirror reflects all, but where even
    /// its microfacets hide each other; what the widest microfacets leave from straight ahead is a sum in closed form.
    #[test]
    fn mirrors_reflect_all_and_rough_metal_loses_much() {
        let tables = common();
        let at = |table: usize, row: usize, column: usize| tables[(table * SIDE + row) * SIDE + column];
        let white = |row, column| at(0, row, column) + at(1, row, column);
        for column in 4..SIDE {
            assert!((white(0, column) - 1.0).abs() < 0.01, "a mirror at column {column}: {}", white(0, column));
        }
        // For alpha = 1, seen from straight ahead, microfacets have the density cos h / pi; light is mirrored to the cosine
        // 2 cos^2 h - 1 and seen again by Smith's share.
        let fine: f64 = (0..100_000)
            .map(|k| {
                let square = (k as f64 + 0.5) / 100_000.0;
                let z = 2.0 * square - 1.0;
                if z > 0.0 { 2.0 * z / (1.0 + z) } else { 0.0 }
            })
            .sum::<f64>()
            / 100_000.0;
        assert!((f64::from(white(SIDE - 1, SIDE - 1)) - fine).abs() < 5e-3, "{} {fine}", white(SIDE - 1, SIDE - 1));
    }

    /// If this failed, smooth glass would gain or lose light.
    #[test]
    fn smooth_glass_keeps_all_light() {
        let tables = glass(1.5);
        for side in 0..2 {
            for column in 4..SIDE {
                let value = tables[side * SIDE * SIDE + column];
                assert!((value - 1.0).abs() < 0.01, "side {side}, column {column}: {value}");
            }
        }
    }
}
