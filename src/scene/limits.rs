//! Limits on camera positions beside the region and the surface: walls, volumes to keep out of, heights that a tripod
//! reaches, ground that can be walked on.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::known::KnownSpace;
use super::similarity::Similarity;
use super::volume::Volume;
use super::voxels::Grid;
use crate::{Error, Result};

/// Coordinates are below this, so that squares of their differences are finite.
pub(crate) const FARTHEST: f64 = 1e18;

/// Limits in the frame of the surface. Walls, volumes and known space apply to cameras and viewers, heights and ground to cameras only.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// No camera or viewer is behind one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub walls: Vec<Wall>,
    /// No camera or viewer is inside one, whether it occludes or not.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keep_out: Vec<Volume>,
    /// Lowest and greatest height of a camera along up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights: Option<[f64; 2]>,
    /// Cameras are above ground that a photographer can walk to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walk: Option<Walk>,
    /// Cameras and viewers are in this space, connected with where photos were taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub space: Option<KnownSpace>,
}

/// A plane with no camera or viewer behind it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wall {
    /// A point of it.
    pub point: DVec3,
    /// Unit normal, to the side of the cameras.
    pub normal: DVec3,
}

/// The walker's size and start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Walk {
    /// Where the feet are at first. The ground is level: stairs are not climbed.
    pub start: DVec3,
    /// Distance kept from obstacles between the knees and the head.
    pub radius: f64,
    /// From the feet to the top of the head, or of the robot.
    pub height: f64,
}

impl Limits {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether some apply to cameras, but not to viewers.
    pub fn narrows(&self) -> bool {
        self.heights.is_some() || self.walk.is_some()
    }

    /// Those that apply to cameras and viewers alike.
    pub fn of_everybody(&self) -> Self {
        Self { heights: None, walk: None, ..self.clone() }
    }

    /// In words, each on a line of its own.
    pub fn lines(&self) -> Vec<String> {
        let wall = |wall: &Wall| format!("wall at {:.3}, cameras to the side of {:.3}", wall.point, wall.normal);
        let volume = |volume: &Volume| match &volume.file[..] {
            "" => format!("no camera in a volume of {} triangles", volume.triangles.len()),
            file if volume.margin > 0.0 => format!("no camera in {file} or within {:.3} of it", volume.margin),
            file => format!("no camera in {file}"),
        };
        let heights = |[low, high]: [f64; 2]| format!("cameras at heights {low:.3} to {high:.3}");
        let walk = |Walk { start, radius, height }: Walk| {
            format!(
                "cameras above ground that is walked to from {start:.3}, with radius {radius:.3} and height {height:.3}"
            )
        };
        let walls = self.walls.iter().map(wall).chain(self.keep_out.iter().map(volume));
        let space = self.space.as_ref().map(KnownSpace::line);
        walls.chain(self.heights.map(heights)).chain(self.walk.map(walk)).chain(space).collect()
    }

    /// The limits themselves, checked, with normals of unit length.
    ///
    /// # Errors
    /// [`Error::Request`] with what is invalid and what to give.
    pub fn validated(mut self) -> Result<Self> {
        let wrong = |what: String| Err(Error::request(what));
        for Wall { point, normal } in &mut self.walls {
            if !(point.abs().max_element() < FARTHEST && normal.abs().max_element() < FARTHEST) {
                return wrong(format!("`wall`: give numbers below {FARTHEST:.0e}"));
            }
            *normal = match normal.try_normalize() {
                Some(unit) => unit,
                None => {
                    return wrong(format!("`wall` at {point} with normal {normal}: give a normal that is not zero"));
                }
            };
        }
        if let Some(Volume { file, margin, .. }) =
            self.keep_out.iter().find(|volume| !(0.0..FARTHEST).contains(&volume.margin))
        {
            return wrong(format!("`keep_out` {file}: its `margin` is {margin}; give a length, or 0"));
        }
        if let Some(Volume { file, .. }) =
            self.keep_out.iter().find(|volume| volume.areas.iter().any(|ring| ring.len() < 3))
        {
            return wrong(format!("`keep_out` {file}: an area has fewer than three corners"));
        }
        if let Some(Volume { file, .. }) = self.keep_out.iter().find(|volume| volume.triangles.is_empty()) {
            return wrong(format!("`keep_out` {file}: it has no faces; give a mesh or boxes"));
        }
        if self.heights.is_some_and(|heights| !heights.iter().all(|height| height.abs() < FARTHEST)) {
            return wrong(format!("`heights`: give numbers below {FARTHEST:.0e}"));
        }
        if let Some([low, high]) = self.heights
            && low >= high
        {
            return wrong(format!("`heights` {low},{high}: give the lower one, then the greater one"));
        }
        if let Some(Walk { start, radius, height }) = self.walk
            && !(start.is_finite() && radius > 0.0 && radius.is_finite() && height > 0.0 && height.is_finite())
        {
            return wrong(format!(
                "`walk` from {start} with radius {radius} and height {height}: give lengths above zero"
            ));
        }
        Ok(self)
    }

    /// The limits in another frame; `up` is that of this one.
    pub fn transformed(&self, similarity: &Similarity, up: DVec3) -> Self {
        let point = |p: DVec3| similarity.point(p);
        let wall =
            |wall: &Wall| Wall { point: point(wall.point), normal: similarity.direction(wall.normal).normalize() };
        let height = |height: f64| point(height * up).dot(similarity.direction(up));
        let walk = |walk: Walk| Walk {
            start: point(walk.start),
            radius: similarity.length(walk.radius),
            height: similarity.length(walk.height),
        };
        let volume = |volume: &Volume| Volume {
            margin: similarity.length(volume.margin),
            triangles: volume.triangles.iter().map(|corners| corners.map(point)).collect(),
            ..volume.clone()
        };
        Self {
            walls: self.walls.iter().map(wall).collect(),
            keep_out: self.keep_out.iter().map(volume).collect(),
            heights: self.heights.map(|heights| heights.map(height)),
            walk: self.walk.map(walk),
            space: self.space.as_ref().map(|space| space.transformed(similarity)),
        }
    }

    /// Whether `p` is excluded by a wall.
    pub fn behind_a_wall(&self, p: DVec3) -> bool {
        self.walls.iter().any(|wall| (p - wall.point).dot(wall.normal) < 0.0)
    }

    /// Marks the voxels that a volume to keep out of touches or holds, or that reach into its margin.
    pub(super) fn fill_volumes(&self, grid: &Grid, marked: &mut [bool]) {
        self.keep_out.iter().for_each(|volume| volume.fill(grid, marked));
    }

    /// Whether `p` is inside of a volume to keep out of, or in its margin.
    pub fn in_a_volume(&self, p: DVec3) -> bool {
        self.keep_out.iter().any(|volume| volume.holds(p))
    }

    /// For every voxel, whether it is excluded; empty where there is no such limit. A voxel that a wall or a volume to keep out
    /// of cuts is barred.
    pub(super) fn barred_for_everybody(&self, grid: &Grid) -> Vec<bool> {
        if self.of_everybody().is_empty() {
            return Vec::new();
        }
        let mut barred = vec![false; grid.voxels()];
        self.fill_volumes(grid, &mut barred);
        let half = 0.5 * grid.cell;
        for (i, barred) in barred.iter_mut().enumerate() {
            let centre = grid.centre(grid.coordinates(i));
            let behind = |wall: &Wall| {
                (centre - wall.point).dot(wall.normal) < half * wall.normal.abs().element_sum() * (1.0 - 1e-9)
            };
            *barred |= self.walls.iter().any(behind)
                || self.space.as_ref().is_some_and(|space| !space.holds_cube(centre, half));
        }
        barred
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::free_space::FreeSpace;
    use crate::scene::proxy::{Occluder, Orientation, Proxy};
    use crate::scene::region::{Region, Shape};
    use crate::scene::samples;
    use crate::scene::volume::box_triangles;

    /// The free space of a box of 6 x 4 x 3 around a cube of side 1 in its middle.
    fn room(limits: Limits) -> Result<FreeSpace> {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted)?;
        let shape = Shape::Box { min: DVec3::new(-3.0, -2.0, -1.5), max: DVec3::new(3.0, 2.0, 1.5) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.1 };
        FreeSpace::among(&proxy.occluder, &region, &limits.validated()?, 60)
    }

    fn volume(min: DVec3, max: DVec3) -> Volume {
        Volume { file: "a box".into(), triangles: box_triangles(min, max), ..Volume::default() }
    }

    fn places(space: &FreeSpace) -> Vec<DVec3> {
        (0..3000).map(|i| space.sample(5, 0, i)).collect()
    }

    /// If this failed, cameras would be planned behind a wall or inside of what they must keep out of.
    #[test]
    fn walls_and_volumes_keep_cameras_out() {
        let normal = DVec3::new(1.0, 0.5, 0.0);
        let limits = Limits {
            walls: vec![Wall { point: DVec3::new(-1.5, 0.0, 0.0), normal }],
            keep_out: vec![
                volume(DVec3::new(1.0, -2.5, -2.0), DVec3::new(2.0, 0.0, 2.0)),
                // Overlapping volumes are still volumes.
                volume(DVec3::new(1.5, -2.5, -2.0), DVec3::new(2.5, 0.0, 2.0)),
            ],
            ..Limits::default()
        };
        let space = room(limits).unwrap();
        for p in places(&space) {
            assert!((p - DVec3::new(-1.5, 0.0, 0.0)).dot(normal) >= 0.0, "{p} is behind the wall");
            assert!(!(1.0..=2.5).contains(&p.x) || p.y >= 0.0, "{p} is in a volume to keep out of");
        }
        // What is projected is free too, and there is free space beyond the volumes.
        for i in 0..500 {
            let p = space.project(6.0 * DVec3::new(f64::from(i % 7), f64::from(i % 11), f64::from(i % 5)) / 7.0 - 3.0);
            assert!(space.is_free(p));
        }
        assert!(space.is_free(DVec3::new(2.8, -1.0, 0.0)) && space.is_free(DVec3::new(1.5, 1.0, 0.0)));
        assert!(!space.is_free(DVec3::new(1.75, -1.0, 0.0)));
    }

    /// If this failed, cameras would be planned at heights that a tripod does not reach, even within one voxel.
    #[test]
    fn heights_hold_exactly() {
        let limits = Limits { heights: Some([0.62, 0.65]), ..Limits::default() };
        let space = room(limits).unwrap();
        for p in places(&space) {
            assert!((0.62..=0.65).contains(&p.z), "{p}");
        }
        let p = space.project(DVec3::new(2.0, 1.0, -1.0));
        assert!((0.62..=0.65).contains(&p.z) && space.is_free(p), "{p}");
        for nonsense in [
            Limits { heights: Some([1.0, 0.5]), ..Limits::default() },
            Limits { walls: vec![Wall { point: DVec3::ZERO, normal: DVec3::ZERO }], ..Limits::default() },
            Limits { keep_out: vec![Volume::default()], ..Limits::default() },
        ] {
            let error = room(nonsense).unwrap_err().to_string();
            assert!(error.starts_with('`') && error.contains("give"), "{error}");
        }
    }

    /// If this failed, cameras would be planned upstairs for viewers who are downstairs, or the half of a flat would be lost where a
    /// tripod is higher than the door.
    #[test]
    fn cameras_and_viewers_are_in_the_same_space() {
        // A partition across x = 1 with a door of 1 x 1.8, and a floor slab or none.
        let block = |min: [f64; 3], max: [f64; 3]| box_triangles(min.into(), max.into());
        let partition = [
            block([1.0, -2.0, -1.5], [1.1, -0.5, 1.5]),
            block([1.0, 0.5, -1.5], [1.1, 2.0, 1.5]),
            block([1.0, -0.5, 0.3], [1.1, 0.5, 1.5]),
        ];
        let shape = Shape::Box { min: DVec3::new(-3.0, -2.0, -1.4), max: DVec3::new(3.0, 2.0, 1.4) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.05 };
        let spaces = |limits: Limits, closed: bool| {
            let door = if closed { block([1.0, -0.6, -1.5], [1.1, 0.6, 1.5]) } else { Vec::new() };
            let occluder = Occluder::Triangles([partition.concat(), door].concat());
            FreeSpace::with_everybody(&occluder, 0, &region, &limits, 60).unwrap()
        };
        let sides = |space: &FreeSpace| {
            let right = places(space).iter().filter(|p| p.x > 1.0).count();
            (right, places(space).len() - right)
        };
        let high = Limits { heights: Some([0.6, 1.0]), ..Limits::default() };
        let (cameras, viewers) = spaces(high, false);
        assert!(sides(&cameras).0 > 500 && sides(&cameras).1 > 500, "{:?}", sides(&cameras));
        assert!(sides(&viewers.unwrap()).0 > 500);
        // The walker is in the smaller room, which is closed.
        let walk = Walk { start: DVec3::new(2.0, 0.0, -1.5), radius: 0.2, height: 1.5 };
        let (cameras, viewers) = spaces(Limits { walk: Some(walk), ..Limits::default() }, true);
        assert_eq!((sides(&cameras).1, sides(&viewers.unwrap()).1), (0, 0));
    }

    /// If this failed, a place outside of the limits would be planned with where region and limits only nearly meet.
    #[test]
    fn limits_that_the_region_only_nearly_meets_are_refused() {
        let proxy = Proxy::new(&samples::cube(), Orientation::Trusted).unwrap();
        let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 2.0, r_max: 3.0 };
        let region = Region { shape, up: DVec3::Z, floor: Some(0.0), clearance: 0.05 };
        let within = |heights| {
            FreeSpace::among(&proxy.occluder, &region, &Limits { heights: Some(heights), ..Limits::default() }, 96)
        };
        assert!(within([-0.03, -0.01]).unwrap_err().to_string().contains("`heights`"));
        let space = within([0.0, 0.02]).unwrap();
        assert!(places(&space).iter().all(|p| (0.0..=0.02).contains(&p.z) && region.contains(*p)));
        // A ceiling below the head stops the walker.
        let ceiling = Wall { point: DVec3::new(0.0, 0.0, 1.2), normal: -DVec3::Z };
        let walk = |height| {
            let walk = Some(Walk { start: DVec3::new(2.5, 0.0, 0.0), radius: 0.2, height });
            FreeSpace::among(&proxy.occluder, &region, &Limits { walls: vec![ceiling], walk, ..Limits::default() }, 96)
        };
        assert!(walk(1.0).is_ok() && walk(1.7).unwrap_err().to_string().contains("`walk`"));
    }

    /// Two rooms with a door: the walker gets through a door that is wide and high enough, and no camera is where the walker
    /// cannot get to.
    #[test]
    fn cameras_stand_above_ground_that_can_be_walked_to() {
        // A partition across x = 0.8 with a door 0.8 wide and 2 high, and a table that is walked around.
        let block = |min: [f64; 3], max: [f64; 3]| box_triangles(min.into(), max.into());
        let partition = [
            block([0.8, -2.0, -1.5], [0.9, 0.5, 1.5]),
            block([0.8, 1.3, -1.5], [0.9, 2.0, 1.5]),
            block([0.8, 0.5, 0.5], [0.9, 1.3, 1.5]),
            block([-2.5, -1.5, -1.5], [-1.5, -0.5, -0.7]),
        ];
        let occluder = Occluder::Triangles(partition.concat());
        let shape = Shape::Box { min: DVec3::new(-3.0, -2.0, -1.4), max: DVec3::new(3.0, 2.0, 1.4) };
        let region = Region { shape, up: DVec3::Z, floor: None, clearance: 0.05 };
        let space = |radius: f64, height: f64| {
            let walk = Some(Walk { start: DVec3::new(-1.0, 1.0, -1.5), radius, height });
            FreeSpace::among(&occluder, &region, &Limits { walk, ..Limits::default() }, 60)
        };
        let beyond = |space: &FreeSpace| places(space).iter().filter(|p| p.x > 1.0).count();
        assert!(beyond(&space(0.25, 1.7).unwrap()) > 500, "the door is wide enough");
        assert_eq!(beyond(&space(0.6, 1.7).unwrap()), 0, "nobody so wide gets through");
        assert_eq!(beyond(&space(0.25, 2.4).unwrap()), 0, "nobody so tall gets through");
        // The walker does not climb the table, so no camera is above it.
        let above = |p: &&DVec3| (-2.4..-1.6).contains(&p.x) && (-1.4..-0.6).contains(&p.y);
        assert_eq!(places(&space(0.25, 1.7).unwrap()).iter().filter(above).count(), 0);
        let blocked = Walk { start: DVec3::new(0.85, -1.0, -1.5), radius: 0.25, height: 1.7 };
        let limits = Limits { walk: Some(blocked), ..Limits::default() };
        let error = FreeSpace::among(&occluder, &region, &limits, 60).unwrap_err().to_string();
        assert!(error.contains("`walk`") && !error.contains('\n'), "{error}");
    }

    /// If this failed, limits would apply in one frame and not in another.
    #[test]
    fn limits_follow_the_frame() {
        let limits = Limits {
            walls: vec![Wall { point: DVec3::ONE, normal: DVec3::X }],
            keep_out: vec![volume(DVec3::ZERO, DVec3::ONE)],
            heights: Some([0.5, 1.5]),
            walk: Some(Walk { start: DVec3::ZERO, radius: 0.3, height: 1.7 }),
            space: None,
        };
        let shape = Shape::Box { min: DVec3::splat(-2.0), max: DVec3::splat(4.0) };
        let region = Region { shape, up: DVec3::Y, floor: None, clearance: 0.1 };
        let frame = region.to_planner_frame();
        let there = limits.transformed(&frame, region.up);
        let lowest = frame.point(DVec3::new(0.3, 0.5, -0.7)).z;
        assert!((there.heights.unwrap()[0] - lowest).abs() < 1e-12);
        assert!(there.behind_a_wall(frame.point(DVec3::new(0.9, 0.0, 0.0))));
        assert!(!there.behind_a_wall(frame.point(DVec3::new(1.1, 0.0, 0.0))));
        let back = there.transformed(&frame.inverse(), DVec3::Z);
        assert!((back.walk.unwrap().height - 1.7).abs() < 1e-12);
        assert!(back.keep_out[0].triangles[0][1].distance(limits.keep_out[0].triangles[0][1]) < 1e-12);
    }

    /// If this failed, a user's own volume would hold other cameras than those inside.
    #[test]
    fn a_volume_is_a_space() {
        let (low, high) = (DVec3::ZERO, DVec3::new(4.0, 2.0, 1.0));
        let space = KnownSpace::inside(&box_triangles(low, high)).unwrap();
        for i in 0..4000 {
            let [u, v, w, _] = crate::scene::random::uniforms(9, 0, i);
            let p = 6.0 * DVec3::new(u, v, w) - 1.0;
            let depth = (p - low).min(high - p).min_element();
            assert!(depth.abs() < 0.05 || space.holds(p) == (depth > 0.0), "{p}");
        }
        assert!(KnownSpace::inside(&[]).is_err());
    }

    /// If this failed, a drone that GPS shows a metre beside where it is would be in an area that it may not enter; one that lies just outside
    /// of the grid, too.
    #[test]
    fn a_margin_is_kept_from_volumes_inside_and_outside_of_the_grid() -> Result<()> {
        for (min, max) in [
            (DVec3::new(1.0, -2.0, -1.5), DVec3::new(2.0, 2.0, 1.5)),
            (DVec3::new(3.2, -2.0, -1.5), DVec3::new(5.0, 2.0, 1.5)),
        ] {
            let limits = Limits { keep_out: vec![Volume { margin: 0.5, ..volume(min, max) }], ..Limits::default() }
                .validated()?;
            let at = |x: f64| DVec3::new(x, 0.1, 0.1);
            assert!(limits.in_a_volume(at(min.x - 0.49)) && !limits.in_a_volume(at(min.x - 0.51)));
            let space = room(limits)?;
            let cell = 6.0 / 60.0;
            for i in 0..40 {
                let x = 0.7 + 0.05 * f64::from(i);
                let away = (min.x - x).max(x - max.x);
                let (inside, beyond) = (away < 0.5 && x < 2.9, away > 0.5 + 2.0 * cell);
                assert!(!inside || space.is_barred(at(x)), "{x} is in the margin of {min}");
                assert!(!beyond || !space.is_barred(at(x)), "{x} is far from {min}");
            }
        }
        assert!(
            Limits { keep_out: vec![Volume { margin: -1.0, ..volume(DVec3::ZERO, DVec3::ONE) }], ..Limits::default() }
                .validated()
                .is_err()
        );
        Ok(())
    }
}
