//! What of a surface is to be seen: the rest blocks views, and nothing is planned for it.

use std::collections::HashSet;

use glam::{DMat3, DVec2, DVec3};

use super::bounding_sphere::bounding_sphere;
use super::proxy::{Occluder, Proxy};
use super::volume::{Triangle, Volume, box_triangles};
use crate::{Error, Result};

/// Points drawn from the surface, and cells along the longer side of a map of them.
const POINTS: usize = 200_000;
const CELLS: f64 = 128.0;
/// Part of the mean height above the ground, each cell counted by its height, from which on something stands on it.
const STANDS: f64 = 0.25;
/// Least height above the ground, as part of the map's longer side, of something that stands on it.
const FLAT: f64 = 0.01;
/// Slope against the plane up to which land is land, about 17 degrees: walls of what stands on it are steeper.
const SLOPE: f64 = 0.3;
/// Of so many points of a surface less than one lies under its ground: a part of the surface below another.
const UNDER: usize = 10;
/// Rounds of fitting the ground to what does not rise above it.
const ROUNDS: usize = 12;

/// Part of the faces of a mesh that a surface has too from which on it is a part of that surface: reading may drop some.
pub const MOST: f64 = 0.9;

/// Corners of a triangle as bits, in one order.
type Key = [[u64; 3]; 3];

fn key(triangle: &Triangle) -> Key {
    // Zero has two signs.
    let mut corners = triangle.map(|corner| corner.to_array().map(|x| (x + 0.0).to_bits()));
    corners.sort_unstable();
    corners
}

/// Part of a subject's faces that are the very triangles of a surface.
pub fn shared_faces(subject: &Volume, surface: impl IntoIterator<Item = Triangle>) -> f64 {
    let faces: HashSet<Key> = subject.triangles.iter().map(key).collect();
    let shared: HashSet<Key> =
        surface.into_iter().map(|triangle| key(&triangle)).filter(|key| faces.contains(key)).collect();
    shared.len() as f64 / faces.len().max(1) as f64
}

/// Which primitives of a surface a subject consists of, where it is a part of that surface.
fn part(subject: &Volume, surface: &Occluder) -> Result<Option<Vec<bool>>> {
    let Occluder::Triangles(triangles) = surface else { return Ok(None) };
    if !subject.part.is_empty() {
        let mut is_in = vec![false; triangles.len()];
        for [start, end] in &subject.part {
            let run = is_in.get_mut(*start..*end);
            run.ok_or_else(|| Error::request("`subject`: it is a part of another surface; give a box or a file"))?
                .fill(true);
        }
        return Ok(Some(is_in));
    }
    if shared_faces(subject, triangles.iter().copied()) < MOST {
        return Ok(None);
    }
    let faces: HashSet<Key> = subject.triangles.iter().map(key).collect();
    Ok(Some(triangles.iter().map(|triangle| faces.contains(&key(triangle))).collect()))
}

/// The runs of what is set: where each starts, and where it ends without that.
fn runs(set: &[bool]) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for (i, _) in set.iter().enumerate().filter(|(_, is_set)| **is_set) {
        match runs.last_mut() {
            Some([_, end]) if *end == i => *end += 1,
            _ => runs.push([i, i + 1]),
        }
    }
    runs
}

/// Leaves in a proxy only the subject to be planned for: where nearly all of its faces are triangles of the surface these, else what lies in
/// it by the middles of the primitives. No point is drawn from the rest, and the sphere is that around the subject. Returns how many
/// primitives are left, and the subject as plans keep it: a part by the numbers of its triangles.
///
/// # Errors
/// Where none is, or it is a part of another surface.
pub fn focus(proxy: &mut Proxy, subject: &Volume) -> Result<(usize, Volume)> {
    let part = part(subject, &proxy.occluder)?;
    let mut corners = Vec::new();
    // Around the volume first: a file's has many faces, and a surface many triangles.
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    subject.triangles.iter().flatten().for_each(|p| (min, max) = (min.min(*p), max.max(*p)));
    let holds = |p: DVec3| p.cmpge(min).all() && p.cmple(max).all() && subject.holds(p);
    let inside: Vec<bool> = match (&proxy.occluder, &part) {
        (Occluder::Triangles(triangles), Some(part)) => {
            corners.extend(triangles.iter().zip(part).filter(|(_, is_in)| **is_in).flat_map(|(triangle, _)| *triangle));
            part.clone()
        }
        (Occluder::Triangles(triangles), None) => triangles
            .iter()
            .map(|triangle| {
                let middle = triangle.iter().sum::<DVec3>() / 3.0;
                let inside = holds(middle);
                if inside {
                    // Of a large triangle no corner may be in it.
                    corners.push(middle);
                    corners.extend(triangle.iter().filter(|corner| holds(**corner)));
                }
                inside
            })
            .collect(),
        (Occluder::Discs(discs), _) => discs
            .iter()
            .map(|disc| {
                let inside = holds(disc.centre);
                corners.extend(inside.then_some(disc.centre));
                inside
            })
            .collect(),
    };
    let left = inside.iter().filter(|inside| **inside).count();
    let sphere = bounding_sphere(&corners).filter(|(_, radius)| *radius > 0.0);
    let (Some(sphere), true) = (sphere, left > 0) else {
        return Err(Error::request(
            "`subject`: nothing of the surface is in it; give a box or volume in the frame of the surface",
        ));
    };
    proxy.sphere = sphere;
    proxy.buried.resize(inside.len(), false);
    for (buried, inside) in proxy.buried.iter_mut().zip(inside) {
        *buried |= !inside;
    }
    let subject = match part {
        Some(part) => Volume { file: subject.file.clone(), part: runs(&part), ..Volume::default() },
        None => subject.clone(),
    };
    Ok((left, subject))
}

/// The largest thing that stands on the ground of a surface, by the volume below its top, as an axis-aligned box from the ground up.
///
/// The ground is a plane, level or sloping, by the lowest points of a map's cells, and hills and valleys on it that are nowhere steeper than
/// [`SLOPE`]; of a base, whose lowest points are its underside, the top.
/// What stands on it are connected cells that rise above by a quarter of the mean rise, in which each cell counts by its own: a mast alone is
/// no more than it holds. Returns the height of the ground there along up, too. A surface that does not end in its ground has none, such as
/// that of an object alone: all of it that is connected counts as standing.
///
/// # Errors
/// Where nothing stands on anything.
pub fn largest(proxy: &Proxy, up: DVec3) -> Result<(Volume, Option<f64>)> {
    let (across, along) = up.any_orthonormal_pair();
    let points: Vec<(DVec2, f64)> = proxy
        .sample(POINTS, 0, 0)
        .iter()
        .map(|point| point.position)
        .map(|p| (DVec2::new(p.dot(across), p.dot(along)), p.dot(up)))
        .collect();
    let low = points.iter().map(|(p, _)| *p).fold(DVec2::INFINITY, DVec2::min);
    let high = points.iter().map(|(p, _)| *p).fold(DVec2::NEG_INFINITY, DVec2::max);
    let side = (high - low).max_element();
    let cell = side / CELLS;
    let dims = ((high - low) / cell).floor().as_uvec2() + 1;
    let index = |p: DVec2| {
        let at = ((p - low) / cell).as_uvec2().min(dims - 1);
        (at.y * dims.x + at.x) as usize
    };
    let middle = |i: usize| low + cell * (DVec2::new((i as u32 % dims.x).into(), (i as u32 / dims.x).into()) + 0.5);
    let mut cells = vec![[f64::INFINITY, f64::NEG_INFINITY]; (dims.x * dims.y) as usize];
    for (p, height) in &points {
        let [bottom, top] = &mut cells[index(*p)];
        (*bottom, *top) = (bottom.min(*height), top.max(*height));
    }
    let seen: Vec<usize> = (0..cells.len()).filter(|i| cells[*i][0].is_finite()).collect();
    let plane = ground(&seen.iter().map(|i| (middle(*i) - low, cells[*i][0])).collect::<Vec<_>>(), FLAT * side);
    // A stray low point, or a pit, is no reason to take the land around it for what stands on it.
    let above = |i: usize| cells[i][0] - plane.dot((middle(i) - low).extend(1.0));
    let [hills, valleys] = [1.0, -1.0].map(|sign| {
        let away = |i: usize| if cells[i][0].is_finite() { (sign * above(i)).max(0.0) } else { f64::INFINITY };
        gentle((0..cells.len()).map(away).collect(), dims.x as usize, SLOPE * cell)
    });
    let land_at = |p: DVec2| plane.dot((p - low).extend(1.0)) + hills[index(p)] - valleys[index(p)];
    // What a surface with ground ends in all around is its ground, and little lies under it.
    let is_edge = |i: usize| {
        let (x, y) = (i as u32 % dims.x, i as u32 / dims.x);
        let is_inside = 0 < x && x < dims.x - 1 && 0 < y && y < dims.y - 1;
        !is_inside || around(i, dims.x as usize, dims.y as usize).any(|j| !cells[j][0].is_finite())
    };
    let edge: Vec<usize> = seen.iter().copied().filter(|i| is_edge(*i)).collect();
    let thick = |i: &usize| cells[*i][1] - land_at(middle(*i));
    let mut thicknesses: Vec<f64> = edge.iter().map(thick).collect();
    thicknesses.sort_by(f64::total_cmp);
    let usual_edge = thicknesses.get(thicknesses.len() / 2).copied().unwrap_or_default();
    let level = |of: &[usize], at: f64| of.iter().filter(|i| (thick(i) - at).abs() <= FLAT * side).count();
    // A base is most of what there is, and much lower than what stands on it; the foot of a statue is neither.
    let highest = seen.iter().map(thick).fold(0.0, f64::max);
    let is_base =
        (FLAT * side..STANDS * highest).contains(&usual_edge) && 4 * level(&seen, usual_edge) > 3 * seen.len();
    let base = if is_base { usual_edge } else { 0.0 };
    let is_below = |p: DVec2, height: f64| height < land_at(p) - FLAT * side;
    let under = points.iter().filter(|(p, height)| is_below(*p, *height) && !is_below(*p, cells[index(*p)][1])).count();
    let has_ground = 2 * level(&edge, base) > edge.len() && UNDER * under < points.len();
    let lowest = points.iter().map(|(_, height)| *height).fold(f64::INFINITY, f64::min);
    let ground_at = |p: DVec2| if has_ground { land_at(p) + base } else { lowest };
    let rise = |i: usize| cells[i][1] - ground_at(middle(i));
    let rises = || seen.iter().map(|i| rise(*i).max(0.0));
    let usual = rises().map(|rise| rise * rise).sum::<f64>() / rises().sum::<f64>().max(f64::MIN_POSITIVE);
    let least = (STANDS * usual).max(FLAT * side);
    let stands = |i: usize| cells[i][0].is_finite() && (!has_ground || rise(i) > least);
    let part = components(dims.x as usize, dims.y as usize, stands);
    let mut volumes = vec![0.0; cells.len()];
    for (i, part) in part.iter().enumerate() {
        if let Some(part) = part {
            volumes[*part] += rise(i);
        }
    }
    let chosen = (0..cells.len()).max_by(|a, b| volumes[*a].total_cmp(&volumes[*b])).filter(|i| volumes[*i] > 0.0);
    let Some(chosen) = chosen else {
        return Err(Error::request(
            "`subject` largest: nothing stands on the ground of this surface; give a box or a file",
        ));
    };
    let of_it = || points.iter().filter(|(p, _)| part[index(*p)] == Some(chosen));
    let bottom = of_it().map(|(p, _)| ground_at(*p)).fold(f64::INFINITY, f64::min);
    let corners = of_it().flat_map(|(p, height)| {
        let at = move |height: f64| p.x * across + p.y * along + height * up;
        [at(*height), at(bottom)]
    });
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    corners.for_each(|p| (min, max) = (min.min(p), max.max(p)));
    // Points are drawn: the surface ends a little beyond the outermost.
    let beyond = 0.5 * cell;
    let subject = Volume { triangles: box_triangles(min - beyond, max + beyond), ..Volume::default() };
    Ok((subject, has_ground.then_some(bottom)))
}

/// Slopes and height of the plane under most of the places, by least squares without those that rise above it by more than `flat` and more
/// than most do.
fn ground(places: &[(DVec2, f64)], flat: f64) -> DVec3 {
    let mut heights: Vec<f64> = places.iter().map(|(_, height)| *height).collect();
    heights.sort_by(f64::total_cmp);
    let mut plane = DVec3::new(0.0, 0.0, heights.get(heights.len() / 2).copied().unwrap_or_default());
    for _ in 0..ROUNDS {
        let off = |(p, height): &(DVec2, f64)| height - plane.dot(p.extend(1.0));
        let mut sizes: Vec<f64> = places.iter().map(|place| off(place).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let most = sizes.get(sizes.len() / 2).copied().unwrap_or_default().max(flat);
        let (mut products, mut sum) = (DMat3::ZERO, DVec3::ZERO);
        for (p, height) in places.iter().filter(|place| off(place).abs() <= 2.0 * most) {
            let x = p.extend(1.0);
            products += DMat3::from_cols(x * x.x, x * x.y, x * x.z);
            sum += x * *height;
        }
        if products.determinant().abs() < 1e-9 * products.col(2).z.powi(3) {
            break;
        }
        plane = products.inverse() * sum;
    }
    plane
}

/// The highest map that lies nowhere above the heights, and rises from cell to cell by no more than `step` along an edge and as much more
/// over a corner as it is farther: one pass from either end, as for distances (Borgefors 1986). Heights may be infinite.
fn gentle(mut heights: Vec<f64>, width: usize, step: f64) -> Vec<f64> {
    let rows = heights.len() / width.max(1);
    let mut pass = |cells: &mut dyn Iterator<Item = usize>, sign: isize| {
        for i in cells {
            let (x, y) = ((i % width) as isize, (i / width) as isize);
            // Those that the pass has been to.
            for (dx, dy) in [(-1, 0), (-1, -1), (0, -1), (1, -1)] {
                let (x, y) = (x + sign * dx, y + sign * dy);
                if (0..width as isize).contains(&x) && (0..rows as isize).contains(&y) {
                    let far = step * f64::from((dx * dx + dy * dy) as u32).sqrt();
                    heights[i] = heights[i].min(heights[y as usize * width + x as usize] + far);
                }
            }
        }
    };
    pass(&mut (0..rows * width), 1);
    pass(&mut (0..rows * width).rev(), -1);
    heights
}

/// A cell and those next to it, over corners too.
fn around(i: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (i % width, i / width);
    (y.saturating_sub(1)..(y + 2).min(height))
        .flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
}

/// For each cell that stands, the first cell of those that it is connected with, over corners too.
fn components(width: usize, height: usize, stands: impl Fn(usize) -> bool) -> Vec<Option<usize>> {
    let mut part = vec![None; width * height];
    for first in 0..width * height {
        if part[first].is_some() || !stands(first) {
            continue;
        }
        let mut open = vec![first];
        part[first] = Some(first);
        while let Some(i) = open.pop() {
            for j in around(i, width, height) {
                if part[j].is_none() && stands(j) {
                    part[j] = Some(first);
                    open.push(j);
                }
            }
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::proxy::Orientation;
    use crate::scene::surface::{Mesh, Surface};

    /// A lawn that rises by `slope` to the side, with a house, a shed and a mast on it; `up` is the frame's.
    fn garden(up: DVec3, slope: f64) -> Proxy {
        let (across, along) = up.any_orthonormal_pair();
        let mut mesh = Mesh::default();
        for (min, max) in [
            ([-80.0, -60.0, -0.2], [80.0, 60.0, 0.0]),
            ([10.0, -4.0, 0.0], [22.0, 6.0, 8.0]),
            ([-30.0, 10.0, 0.0], [-26.0, 14.0, 3.0]),
            ([-50.0, -20.0, 0.0], [-49.5, -19.5, 40.0]),
        ] {
            for corners in box_triangles(DVec3::from_array(min), DVec3::from_array(max)) {
                let first = mesh.positions.len() as u32;
                mesh.positions.extend(corners.map(|p| p.x * across + p.y * along + (p.z + slope * (p.x - 16.0)) * up));
                mesh.triangles.push([first, first + 1, first + 2]);
            }
        }
        Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap()
    }

    /// If this failed, cameras would stand around a hill, or a house on a hill with half of the hill would be the subject.
    #[test]
    fn a_hill_is_no_subject() {
        // Rolling land with a house on a hillside, as a drone's mesh has it: roof, walls and ground in one sheet; a pond that was dug, and a
        // point far below as reconstructions have them.
        let land = |x: f64, y: f64| {
            let hill = 9.0 * (-((x - 30.0).powi(2) + (y + 10.0).powi(2)) / 800.0).exp() + 2.0 * (x / 18.0).sin();
            let dug = if (-60.0..-38.0).contains(&x) && (-20.0..2.0).contains(&y) { 8.0 } else { 0.0 };
            hill - if (x, y) == (-50.0, 40.0) { 12.0 } else { dug }
        };
        let house = |x: f64, y: f64| (18.0..28.0).contains(&x) && (-4.0..6.0).contains(&y);
        let height = |x: f64, y: f64| if house(x, y) { land(23.0, 1.0) + 7.0 } else { land(x, y) };
        let place = |i: usize| f64::from(i as u32 % 161) - 80.0;
        let row = |i: usize| f64::from(i as u32 / 161) - 60.0;
        let mut mesh = Mesh::default();
        for i in 0..161 * 121 {
            mesh.positions.push(DVec3::new(place(i), row(i), height(place(i), row(i))));
            if i % 161 < 160 && i / 161 < 120 {
                let [a, b, c, d] = [i, i + 1, i + 162, i + 161].map(|i| i as u32);
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let proxy = Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap();
        let (subject, bottom) = largest(&proxy, DVec3::Z).unwrap();
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        subject.triangles.iter().flatten().for_each(|p| (min, max) = (min.min(*p), max.max(*p)));
        let wanted = [DVec3::new(17.5, -4.5, land(18.0, 6.0)), DVec3::new(27.5, 5.5, land(23.0, 1.0) + 7.0)];
        assert!(min.distance(wanted[0]) < 2.5 && max.distance(wanted[1]) < 2.5, "{min} to {max}, not {wanted:?}");
        let bottom = bottom.unwrap();
        assert!((bottom - land(18.0, 6.0)).abs() < 2.0, "{bottom}");
    }

    /// If this failed, a mesh that is a part of a scene would be taken for a volume, which an open one is not: with it what it stands on or
    /// holds would be planned for.
    #[test]
    fn a_part_of_the_surface_is_itself_the_subject() {
        let quad = |low: f64, high: f64, z: f64| {
            let corner = |x, y| DVec3::new(x, y, z);
            let [a, b, c, d] = [corner(low, low), corner(high, low), corner(high, high), corner(low, high)];
            [[a, b, c], [a, c, d]]
        };
        // An open dish over a table that is seen within its outline.
        let (dish, table) = (quad(-1.0, 1.0, 0.5), quad(-1.0, 1.0, -0.0));
        let positions = dish.iter().chain(&table).flatten().copied().collect();
        let triangles = (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let surface = Surface::Mesh(Mesh { positions, triangles, ..Mesh::default() });
        let proxy = Proxy::new(&surface, Orientation::Trusted).unwrap();
        let turned = |[a, b, c]: Triangle| [b, c, a];
        let subject = Volume { triangles: dish.map(turned).to_vec(), ..Volume::default() };
        let mut focused = proxy.clone();
        assert_eq!([shared_faces(&subject, dish), shared_faces(&subject, table)], [1.0, 0.0]);
        let (left, kept) = focus(&mut focused, &subject).unwrap();
        assert_eq!((left, &*kept.part, kept.triangles.len()), (2, &[[0, 2]][..], 0));
        assert!(focused.sample(100, 3, 1).iter().all(|point| (point.position.z - 0.5).abs() < 1e-6));
        assert!(focused.sphere.0.distance(DVec3::new(0.0, 0.0, 0.5)) < 1e-9, "{:?}", focused.sphere);
        let table = Volume { triangles: quad(-1.0, 1.0, 0.0).to_vec(), ..Volume::default() };
        assert_eq!(focus(&mut proxy.clone(), &table).unwrap().1.part, [[2, 4]]);
        // As a plan has it, and of a plan of something larger.
        let mut again = proxy.clone();
        assert_eq!((focus(&mut again, &kept).unwrap().0, again.sphere), (2, focused.sphere));
        for wrong in [[3, 5], [2, 1]] {
            let other = Volume { part: vec![wrong], ..Volume::default() };
            assert!(focus(&mut proxy.clone(), &other).unwrap_err().to_string().contains("another surface"));
        }
        // A hull that rests on one of the table's triangles is a volume: what is in it counts.
        let mut hull = box_triangles(DVec3::new(-2.0, -2.0, 0.2), DVec3::splat(2.0)).to_vec();
        hull.push(table.triangles[0]);
        let (left, hull) = focus(&mut proxy.clone(), &Volume { triangles: hull, ..Volume::default() }).unwrap();
        assert!(left >= 2 && hull.part.is_empty(), "{left}");
    }

    /// If this failed, cameras would stand around a lawn of 160 m with a house somewhere in it, or around a pole.
    #[test]
    fn the_house_is_found_on_its_lawn() {
        let aslant = DVec3::new(0.1, 0.9, -0.2).normalize();
        for (up, slope) in [(DVec3::Z, 0.0), (DVec3::Y, 0.0), (aslant, 0.0), (DVec3::Z, 0.12)] {
            let mut proxy = garden(up, slope);
            let whole = proxy.sphere.1;
            let (subject, ground) = largest(&proxy, up).unwrap();
            let ground = ground.unwrap();
            let (left, _) = focus(&mut proxy, &subject).unwrap();
            let (across, along) = up.any_orthonormal_pair();
            let middle = 16.0 * across + 1.0 * along + 4.0 * up;
            let (centre, radius) = proxy.sphere;
            assert!(whole > 90.0 && left == 12 && ground.abs() < 0.3 + 8.0 * slope, "{whole}, {left}, {ground}");
            // Half of the diagonal of 12 x 10 x 8, and a little of the lawn beside it.
            let wanted = 308f64.sqrt() / 2.0;
            assert!(
                centre.distance(middle) < 1.0 && (wanted - 0.1..wanted + 1.0).contains(&radius),
                "{up}: {centre}, {radius}"
            );
            let points = proxy.sample(1000, 3, 1);
            let away = |p: DVec3| p.distance(middle) > radius + 1.0;
            assert!(points.len() == 1000 && !points.iter().any(|point| away(point.position)));
        }
        let (flat, nowhere) = (DVec3::new(10.0, 10.0, 0.01), DVec3::splat(500.0));
        let lawn = box_triangles(-flat, flat);
        let positions = lawn.iter().flatten().copied().collect();
        let triangles = (0..lawn.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions, triangles, ..Mesh::default() };
        let mut proxy = Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap();
        assert!(largest(&proxy, DVec3::Z).unwrap_err().to_string().contains("nothing stands"));
        let empty = Volume { triangles: box_triangles(nowhere, nowhere + 1.0), ..Volume::default() };
        assert!(focus(&mut proxy, &empty).unwrap_err().to_string().contains("`subject`"));
    }

    fn boxes(of: &[[[f64; 3]; 2]]) -> Proxy {
        let mut mesh = Mesh::default();
        for corners in of.iter().flat_map(|[min, max]| box_triangles(DVec3::from_array(*min), DVec3::from_array(*max)))
        {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap()
    }

    /// If this failed, a chair alone would get a floor through its seat, and nothing below would be planned for.
    #[test]
    fn an_object_without_ground_is_all_of_the_subject_and_gets_no_floor() {
        let leg = |x: f64, y: f64| [[x, y, 0.0], [x + 0.04, y + 0.04, 0.45]];
        let mut chair = vec![[[0.0, 0.0, 0.45], [0.5, 0.5, 0.5]], [[0.1, 0.46, 0.5], [0.4, 0.5, 1.0]]];
        chair.extend([leg(0.0, 0.0), leg(0.46, 0.0), leg(0.0, 0.46), leg(0.46, 0.46)]);
        let bounds = |subject: &Volume| {
            let corners = || subject.triangles.iter().flatten();
            (corners().fold(DVec3::INFINITY, |a, b| a.min(*b)), corners().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b)))
        };
        let (subject, floor) = largest(&boxes(&chair), DVec3::Z).unwrap();
        let (min, max) = bounds(&subject);
        assert_eq!(floor, None);
        assert!(min.max_element() < 0.0 && max.cmpgt(DVec3::new(0.5, 0.5, 0.99)).all(), "{min} to {max}");
        // On the ground it has one, and on a thick base.
        for thickness in [0.01, 0.2] {
            let on_ground = [&chair[..], &[[[-2.0, -2.0, -thickness], [2.0, 2.0, 0.0]]]].concat();
            let (subject, floor) = largest(&boxes(&on_ground), DVec3::Z).unwrap();
            let (min, max) = bounds(&subject);
            assert!(floor.unwrap().abs() < 0.02, "{floor:?}");
            assert!(min.truncate().min_element() > -0.1 && max.max_element() < 1.1, "{min} to {max}");
        }
    }

    /// If this failed, a scan that is open below, or a thing that narrows upward, would get a floor through its middle.
    #[test]
    fn what_falls_away_to_its_edges_has_no_ground() {
        let turned = |profile: &dyn Fn(f64) -> f64| {
            let (rings, round) = (40, 64);
            let mut mesh = Mesh::default();
            for ring in 0..=rings {
                let radius = f64::from(ring) / f64::from(rings);
                mesh.positions.extend((0..round).map(|i| {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(round)).sin_cos();
                    DVec3::new(radius * cos, radius * sin, profile(radius))
                }));
            }
            for (ring, i) in (0..rings).flat_map(|ring| (0..round).map(move |i| (ring, i))) {
                let [a, b] = [ring * round + i, ring * round + (i + 1) % round];
                mesh.triangles.extend([[a, a + round, b], [b, a + round, b + round]]);
            }
            Proxy::new(&Surface::Mesh(mesh), Orientation::Trusted).unwrap()
        };
        let [dome, cone]: [&dyn Fn(f64) -> f64; 2] = [&|r| (1.0 - r * r).sqrt(), &|r| 2.0 - 2.0 * r];
        for profile in [dome, cone] {
            let (subject, floor) = largest(&turned(profile), DVec3::Z).unwrap();
            let lowest = subject.triangles.iter().flatten().map(|p| p.z).fold(f64::INFINITY, f64::min);
            assert!(floor.is_none() && lowest < 0.05, "a floor at {floor:?}, the subject from {lowest}");
        }
    }
}
