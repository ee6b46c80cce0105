//! From points to discs: normals, radii, outliers and thinning of a point cloud.

use std::num::NonZero;

use glam::{DMat3, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::least_spread::direction_of_least_variance;
use super::morton;
use super::orientation::Orientation;
use super::stray::Reach;
use super::surface::Points;
use crate::{Error, Result};

/// A flat disc that represents the surface around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Centre in the world.
    pub centre: DVec3,
    /// Unit normal, toward the visible side.
    pub normal: DVec3,
    /// Radius, > 0.
    pub radius: f64,
}

/// Most discs that a cloud is turned into.
const MAX_DISCS: usize = 200_000;
/// Neighbours that a normal is fitted to, and outliers are judged by.
const NEIGHBOURS: usize = 12;
/// Nearest neighbours whose mean distance is the radius of a disc. On a square grid that covers the surface; on a random
/// scatter it leaves about 5% open.
const RADIUS_NEIGHBOURS: usize = 6;
/// No disc is larger than this many times the median radius.
const LARGEST_RADIUS: f64 = 4.0;

/// The discs of a cloud, along a Morton curve.
pub(super) struct Cloud {
    /// The discs.
    pub discs: Vec<Disc>,
    /// Index of the point that each disc represents.
    pub source: Vec<usize>,
    /// Points dropped as outliers of their neighbourhood.
    pub outliers: usize,
    /// Points left aside because they lie far away from all others.
    pub stray: usize,
}

/// Turns points into discs. Positions must be finite.
///
/// Normals: the given one, else the direction of least variance of the neighbours. Their sign: toward the cameras
/// that saw the point, else as given where the cloud is oriented, else as `orientation` specifies; a sign that nothing
/// decides points away from the cloud's centroid. Radii: the given one, else the mean distance to the six nearest.
pub(super) fn from_points(points: &Points, orientation: Orientation) -> Result<Cloud> {
    let n = points.positions.len();
    for (what, length) in [
        ("normals", points.normals.len()),
        ("radii", points.radii.len()),
        ("colours", points.colours.len()),
        ("scores", points.scores.len()),
        ("variances", points.variances.len()),
        ("camera directions", points.toward_cameras.len()),
    ] {
        if length != 0 && length != n {
            return Err(Error::request(format!("points: {length} {what} for {n} points; give all or none")));
        }
    }
    let reach = Reach::of(&points.positions);
    let near: Vec<usize> = (0..n).filter(|i| reach.holds(points.positions[*i])).collect();
    let stray = n - near.len();
    let kept = thinned(&points.positions, near);
    if kept.len() < 4 {
        return Err(Error::request(format!("points: {} distinct points; a surface needs at least 4", kept.len())));
    }
    let positions: Vec<DVec3> = kept.iter().map(|i| points.positions[*i]).collect();
    let neighbours = nearest(&positions)?;
    let spread = |count: usize| -> Vec<f64> {
        let mean = |near: &Vec<(f64, usize)>| {
            let count = count.min(near.len());
            near[..count].iter().map(|(distance, _)| distance).sum::<f64>() / count as f64
        };
        neighbours.iter().map(mean).collect()
    };
    let inlier = inliers(&spread(NEIGHBOURS), &neighbours);
    let centroid = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let mut cloud = Cloud { discs: Vec::new(), source: Vec::new(), outliers: 0, stray };
    for (i, spacing) in spread(RADIUS_NEIGHBOURS).into_iter().enumerate() {
        if !inlier[i] {
            cloud.outliers += 1;
            continue;
        }
        let given = points.radii.get(kept[i]).map_or(0.0, |r| f64::from(*r));
        // A cloud that was thinned has wider gaps than its own radii were made for.
        let cover = kept.len() + stray == n && given.is_finite() && given > 0.0;
        let radius = if cover { given } else { spacing };
        let around = || std::iter::once(positions[i]).chain(neighbours[i].iter().map(|(_, j)| positions[*j]));
        let normal = normal(points, kept[i], orientation, centroid, around);
        cloud.discs.push(Disc { centre: positions[i], normal, radius });
        cloud.source.push(kept[i]);
    }
    let largest = LARGEST_RADIUS * median(cloud.discs.iter().map(|disc| disc.radius).collect());
    for disc in &mut cloud.discs {
        disc.radius = disc.radius.min(largest);
    }
    Ok(cloud)
}

/// Indices of those `among` the points that stay, along a Morton curve: one for each occupied cell of the finest power-of-two grid
/// with at most [`MAX_DISCS`] occupied cells. Points less than two millionths of the cloud's size apart are one.
fn thinned(positions: &[DVec3], among: Vec<usize>) -> Vec<usize> {
    let (min, max) = among
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), i| (min.min(positions[*i]), max.max(positions[*i])));
    let side = (max - min).max_element();
    let mut coded: Vec<(u64, usize)> = among.into_iter().map(|i| (morton::code(positions[i], min, side), i)).collect();
    coded.sort_unstable();
    for level in 0..=morton::BITS {
        coded.dedup_by_key(|(code, _)| *code >> (3 * level));
        if coded.len() <= MAX_DISCS {
            break;
        }
    }
    coded.into_iter().map(|(_, i)| i).collect()
}

/// Distance and index of up to [`NEIGHBOURS`] nearest other points of each point, nearest first. Positions are distinct.
fn nearest(positions: &[DVec3]) -> Result<Vec<Vec<(f64, usize)>>> {
    let coordinates: Vec<[f64; 3]> = positions.iter().map(DVec3::to_array).collect();
    // Serial, so that ties at equal distance do not depend on the number of threads.
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::builder()
        .with_serial_construction()
        .build_from_slice(&coordinates)
        .map_err(|e| Error::request(format!("points: no search tree over them can be built: {e}")))?;
    let wanted = NonZero::new(NEIGHBOURS + 1).unwrap_or(NonZero::<usize>::MIN);
    let others = |(i, p): (usize, &[f64; 3])| {
        let found = tree.query(p).nearest_n::<SquaredEuclidean<f64>>(wanted).execute();
        let mut near: Vec<(f64, usize)> = found
            .into_iter()
            .filter(|hit| hit.item as usize != i)
            .map(|hit| (hit.distance.sqrt(), hit.item as usize))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near
    };
    Ok(coordinates.iter().enumerate().map(others).collect())
}

/// Whether each point belongs to the surface, by its mean distance to its neighbours. It does not where that is
/// extraordinary for the cloud (beyond three medians and eight standard deviations, as estimated from the median absolute
/// deviation) and either for its neighbourhood too (beyond twice the neighbours' median) or beyond ten medians: a part
/// that was merely scanned more sparsely stays.
fn inliers(spread: &[f64], neighbours: &[Vec<(f64, usize)>]) -> Vec<bool> {
    let middle = median(spread.to_vec());
    let deviation = 1.4826 * median(spread.iter().map(|d| (d - middle).abs()).collect());
    let limit = (middle + 8.0 * deviation).max(3.0 * middle);
    let ordinary = |(d, near): (&f64, &Vec<(f64, usize)>)| {
        let local = || median(near.iter().map(|(_, j)| spread[*j]).collect());
        *d <= limit || (*d <= 10.0 * middle && *d <= 2.0 * local())
    };
    spread.iter().zip(neighbours).map(ordinary).collect()
}

/// The (upper) median of at least one number.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The oriented unit normal of point `i`, whose neighbourhood is `around`.
fn normal<I: Iterator<Item = DVec3>>(
    points: &Points,
    i: usize,
    orientation: Orientation,
    centroid: DVec3,
    around: impl Fn() -> I,
) -> DVec3 {
    let given = points.normals.get(i).and_then(|normal| normal.try_normalize());
    let normal = given.unwrap_or_else(|| {
        let count = around().count() as f64;
        let mean = around().sum::<DVec3>() / count;
        let covariance =
            around().map(|p| p - mean).fold(DMat3::ZERO, |m, d| m + DMat3::from_cols(d * d.x, d * d.y, d * d.z));
        direction_of_least_variance(covariance)
    });
    let toward = points.toward_cameras.get(i).copied().unwrap_or(DVec3::ZERO);
    let position = points.positions[i];
    let hint = if toward.dot(normal) != 0.0 {
        toward
    } else if given.is_some() && (points.oriented || orientation == Orientation::Trusted) {
        normal
    } else {
        match orientation {
            Orientation::Inward(centre) => centre - position,
            Orientation::Outward(centre) => position - centre,
            Orientation::Trusted => position - centroid,
        }
    };
    if hint.dot(normal) < 0.0 { -normal } else { normal }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn sphere(n: u32) -> Vec<DVec3> {
        (0..n)
            .map(|i| {
                let [u, v, ..] = random::uniforms(11, 0, i);
                random::direction(u, v)
            })
            .collect()
    }

    fn cloud(positions: Vec<DVec3>) -> Points {
        Points { positions, ..Points::default() }
    }

    /// Normals that are wrong or point inward would hide the surface from every camera.
    #[test]
    fn a_sphere_of_points_gets_its_normals() {
        for (orientation, sign) in [
            (Orientation::Outward(DVec3::ZERO), 1.0),
            (Orientation::Inward(DVec3::ZERO), -1.0),
            (Orientation::Trusted, 1.0),
        ] {
            let cloud = from_points(&cloud(sphere(4000)), orientation).unwrap();
            let mean = cloud.discs.iter().map(|d| sign * d.normal.dot(d.centre)).sum::<f64>() / 4000.0;
            assert!(mean > 0.99, "{orientation:?}: mean cosine {mean}");
            assert!(cloud.discs.iter().all(|d| sign * d.normal.dot(d.centre) > 0.8));
        }
    }

    /// The cameras that saw a point determine its visible side better than any centre does.
    #[test]
    fn cameras_and_trusted_normals_come_before_the_orientation() {
        let positions = sphere(500);
        let toward_cameras = positions.iter().map(|p| -*p).collect();
        let seen = Points { toward_cameras, ..cloud(positions.clone()) };
        let inward: Vec<DVec3> = positions.iter().map(|p| -*p).collect();
        let oriented = Points { normals: inward.clone(), oriented: true, ..cloud(positions.clone()) };
        let shape_only = Points { normals: inward, ..cloud(positions) };
        let facing_in = |points: &Points| {
            let cloud = from_points(points, Orientation::Outward(DVec3::ZERO)).unwrap();
            cloud.discs.iter().filter(|d| d.normal.dot(d.centre) < 0.0).count()
        };
        assert_eq!((facing_in(&seen), facing_in(&oriented), facing_in(&shape_only)), (500, 500, 0));
    }

    /// Gross holes would let rays leak through the surface: on a grid every spot must be covered by some disc.
    #[test]
    fn discs_on_a_grid_cover_it() {
        let positions = (0..900).map(|i| DVec3::new(f64::from(i % 30), f64::from(i / 30), 0.0)).collect();
        let cloud = from_points(&cloud(positions), Orientation::Outward(DVec3::NEG_Z)).unwrap();
        assert_eq!((cloud.discs.len(), cloud.outliers), (900, 0));
        for i in 0..500 {
            let [u, v, ..] = random::uniforms(2, 0, i);
            let spot = DVec3::new(29.0 * u, 29.0 * v, 0.0);
            assert!(cloud.discs.iter().any(|d| d.centre.distance(spot) <= d.radius), "a hole at {spot}");
        }
        assert!(cloud.discs.iter().all(|d| d.radius < 2.5 && d.normal.dot(DVec3::Z) > 0.999));
    }

    /// One stray point must not become a disc that blocks the view, nor, however far away it lies, set the scale at which
    /// points count as the same.
    #[test]
    fn outliers_and_strays_are_left_aside_and_counted() {
        for far in [1e3, 1e6, 1e9] {
            let mut positions = sphere(2000);
            positions.extend([DVec3::splat(9.0), DVec3::new(-7.0, 0.0, 3.0), DVec3::new(0.0, far, far)]);
            let cloud = from_points(&cloud(positions), Orientation::Trusted).unwrap();
            assert_eq!((cloud.discs.len(), cloud.outliers, cloud.stray), (2000, 2, 1), "{far}");
        }
    }

    /// Duplicates are no neighbours: they would give discs of radius zero, which block nothing.
    #[test]
    fn duplicates_do_not_shrink_the_discs() {
        let once = sphere(300);
        let mut thrice = [once.clone(), once.clone(), once].concat();
        random::shuffle(&mut thrice, 1, 0);
        let cloud = from_points(&cloud(thrice), Orientation::Trusted).unwrap();
        assert_eq!(cloud.discs.len(), 300);
        assert!(cloud.discs.iter().all(|d| d.radius > 0.03));
    }

    /// Three points, or one point a thousand times, make no surface; the user must be told so.
    #[test]
    fn too_few_points_are_refused() {
        for positions in [vec![], vec![DVec3::ONE; 1000], vec![DVec3::ZERO, DVec3::X, DVec3::Y]] {
            let message = from_points(&cloud(positions), Orientation::Trusted).err().unwrap().to_string();
            assert!(message.contains("distinct points"), "{message}");
        }
    }

    /// A dense scan must not take gigabytes of tree nodes, and must stay evenly spread when it is thinned.
    #[test]
    fn dense_clouds_are_thinned() {
        let kept = thinned(&sphere(400_000), (0..400_000).collect());
        assert!((MAX_DISCS / 8..=MAX_DISCS).contains(&kept.len()), "{} kept", kept.len());
    }
}
