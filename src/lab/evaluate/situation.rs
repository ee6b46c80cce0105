//! Practical situations: what surrounds an object, who looks at it, what has been photographed already; and rooms of our own.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::kind::Kind;
use super::settings::BaselinesFrom;
use crate::planner::plan::simple_layouts::even_layout;
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::limits::{Limits, Wall};
use crate::scene::model::Model;
use crate::scene::random;
use crate::scene::region::{Region, Shape};
use crate::scene::samples::textured::{SingleRoom, Surroundings, furnished_room, two_rooms_model};
use crate::scene::volume::{Volume, box_triangles};
use crate::visibility::device_scene::SceneGeometry;
use crate::{Error, Result};

/// Full angle in degrees within which people look from the front.
const FRONT_DEG: f64 = 120.0;
/// Between an object and the floor or a wall, in radii of the object.
const GAP: f64 = 0.01;
/// How far floor and walls reach from the middle, in outer radii of the region.
const REACH: f64 = 1.5;
/// Obstacles around an object in clutter.
const THINGS: u32 = 6;
/// Seed of their positions, and of the side that photos are from.
const SEED: u64 = 0x7369_7475;
const SIDE: u32 = 0x7369_6465;

/// A situation that something is photographed in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Situation {
    /// Free all around
    #[default]
    Free,
    /// On a floor, seen from above it
    Floor,
    /// On a floor against a wall
    Wall,
    /// On a floor in a corner
    Corner,
    /// On a floor among six blocks that hide it and keep cameras out
    Clutter,
    /// Free all around; as many photos as the budget exist already, from one side
    OneSide,
    /// Free all around; viewers in front only, within 120 degrees
    Front,
    /// Two furnished rooms with a door between them, in place of a scene file
    TwoRooms,
    /// A room with a few things along its walls, in place of a scene file
    BareRoom,
    /// A furnished room, in place of a scene file
    FurnishedRoom,
    /// A room with things wherever there is a place, in place of a scene file
    CrowdedRoom,
    /// A long room, in place of a scene file
    LongRoom,
    /// A room full of shelves, in place of a scene file
    Library,
    /// A small room with full walls, in place of a scene file
    SmallRoom,
}

impl Situation {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Floor => "floor",
            Self::Wall => "wall",
            Self::Corner => "corner",
            Self::Clutter => "clutter",
            Self::OneSide => "one-side",
            Self::Front => "front",
            Self::TwoRooms => "two-rooms",
            Self::BareRoom => "bare-room",
            Self::FurnishedRoom => "furnished-room",
            Self::CrowdedRoom => "crowded-room",
            Self::LongRoom => "long-room",
            Self::Library => "library",
            Self::SmallRoom => "small-room",
        }
    }

    /// In words, as a table has them; nothing where it is the usual one.
    pub fn words(self) -> &'static str {
        match self {
            Self::Free => "",
            Self::Floor => ", objects on a floor",
            Self::Wall => ", objects on a floor against a wall",
            Self::Corner => ", objects on a floor in a corner",
            Self::Clutter => ", objects on a floor among six other things",
            Self::OneSide => ", as many photos from one side there already",
            Self::Front => ", viewers within 120 degrees in front",
            Self::TwoRooms => ", two rooms with a door between them",
            Self::BareRoom => ", a room with a few things",
            Self::FurnishedRoom => ", a furnished room",
            Self::CrowdedRoom => ", a crowded room",
            Self::LongRoom => ", a long room",
            Self::Library => ", a room full of shelves",
            Self::SmallRoom => ", a small room",
        }
    }

    /// Whether it puts obstacles around an object.
    pub fn furnishes(self) -> bool {
        matches!(self, Self::Floor | Self::Wall | Self::Corner | Self::Clutter)
    }

    /// Whether viewers look at objects from other positions than around a free one.
    pub fn has_viewers(self) -> bool {
        self.furnishes() || self == Self::Front
    }

    /// The rooms that are the scene themselves; none where it is of objects in files.
    pub fn rooms(self) -> Option<Model> {
        if self == Self::TwoRooms { Some(two_rooms_model()) } else { self.single_room().map(furnished_room) }
    }

    /// Whether it has [`Self::rooms`].
    pub fn is_room(self) -> bool {
        self == Self::TwoRooms || self.single_room().is_some()
    }

    fn single_room(self) -> Option<SingleRoom> {
        match self {
            Self::BareRoom => Some(SingleRoom::Bare),
            Self::FurnishedRoom => Some(SingleRoom::Furnished),
            Self::CrowdedRoom => Some(SingleRoom::Crowded),
            Self::LongRoom => Some(SingleRoom::Long),
            Self::Library => Some(SingleRoom::Library),
            Self::SmallRoom => Some(SingleRoom::Small),
            _ => None,
        }
    }

    /// Where viewers look from by default.
    pub fn viewers(self) -> Viewers {
        match self {
            // The front of a glTF asset is towards +Z.
            Self::Front => Viewers::Cone { axis: DVec3::Z, degrees: FRONT_DEG },
            _ => Viewers::Region,
        }
    }

    /// Refuses what does not go together with it.
    ///
    /// # Errors
    /// In a line that names the option.
    pub fn check(self, kind: Kind, viewers: &Viewers, baselines_from: BaselinesFrom) -> Result<()> {
        if self == Self::Free {
            return Ok(());
        }
        let name = self.name();
        let (wanted, of) = if self.is_room() { (Kind::Room, "rooms") } else { (Kind::Object, "objects") };
        if kind != wanted {
            return Err(Error::request(format!("--situation {name}: it is of {of}; leave it, --preset or --box out")));
        }
        if self == Self::Front && *viewers != self.viewers() {
            return Err(Error::request("--situation front: it says where viewers are; leave it or --viewers out"));
        }
        if baselines_from == BaselinesFrom::Sphere {
            return Err(Error::request(
                "--baselines-from sphere, which --paper asks for too, is of free objects; leave it or --situation out",
            ));
        }
        Ok(())
    }

    /// Adds what surrounds an object to its model, +Y up. `bounds` and `radius` are the object's, `region` is the shell around it
    /// while it is free. Returns the remaining region and its limits.
    pub fn furnish(self, model: &mut Model, bounds: (DVec3, DVec3), radius: f64, region: Region) -> (Region, Limits) {
        let Shape::Shell { centre, r_min, r_max } = region.shape else { return (region, Limits::default()) };
        let walls = match self {
            Self::Floor | Self::Clutter => 0,
            Self::Wall => 1,
            Self::Corner => 2,
            _ => return (region, Limits::default()),
        };
        // Floor and walls reach as far on all sides, but not behind a wall.
        let low = bounds.0 - GAP * radius;
        let [mut from, to] = [-1.0, 1.0].map(|way| centre + way * REACH * r_max);
        if walls > 0 {
            from.x = low.x;
        }
        if walls > 1 {
            from.z = low.z;
        }
        from.y = low.y;
        let size = to - from;
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * size);
        let mut add = Surroundings::new(model, radius);
        let mut limits = Limits::default();
        add.floor(from, [z, x]);
        if walls > 0 {
            add.wall(from + z, [-z, y]);
            limits.walls.push(Wall { point: from, normal: DVec3::X });
        }
        if walls > 1 {
            add.wall(from, [x, y]);
            limits.walls.push(Wall { point: from, normal: DVec3::Z });
        }
        if self == Self::Clutter {
            for i in 0..THINGS {
                let [a, b, c, d] = random::uniforms(SEED, 0, i);
                let angle = std::f64::consts::TAU * (f64::from(i) + 0.7 * a) / f64::from(THINGS);
                // Between the object and the cameras, or where these would be.
                let out = 0.75 * r_min + b * (0.95 * r_max - 0.75 * r_min);
                let half = radius * (0.3 + 0.25 * c);
                let foot = DVec3::new(centre.x + out * angle.cos(), low.y, centre.z + out * angle.sin());
                let (min, top) = (foot - DVec3::new(half, 0.0, half), (0.7 + 1.8 * d) * radius);
                let max = foot + DVec3::new(half, top, half);
                add.thing(min, max, i);
                limits.keep_out.push(Volume { triangles: box_triangles(min, max), ..Volume::default() });
            }
        }
        (Region { floor: Some(low.y), ..region }, limits)
    }

    /// The photos that have been taken already where `views` may be taken: evenly from one side, a third of the sphere, which each seed
    /// has of its own.
    ///
    /// # Errors
    /// Where the region is no shell.
    pub fn kept(self, geometry: &SceneGeometry, intrinsics: Intrinsics, views: u32, seed: u64) -> Result<Vec<Camera>> {
        if self != Self::OneSide {
            return Ok(Vec::new());
        }
        let [u, v, w, t] = random::uniforms(seed ^ SEED, SIDE, 0);
        let turn = random::rotation([u, v, w]);
        let mut poses = even_layout(geometry, &Viewers::Region, 3 * views as usize, turn)?;
        let up = geometry.region.up;
        let side = DQuat::from_axis_angle(up, std::f64::consts::TAU * t) * up.any_orthonormal_vector();
        let aside = |pose: &Pose| pose.forward().dot(side);
        poses.sort_by(|a, b| aside(a).total_cmp(&aside(b)));
        let back = geometry.to_internal.inverse();
        let kept =
            |(i, pose): (usize, &Pose)| Camera { name: format!("kept_{i:04}"), pose: back.pose(pose), intrinsics };
        Ok(poses[..views as usize].iter().enumerate().map(kept).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::plan::config::Preset;
    use crate::planner::plan::target::{RegionChoice, Target};
    use crate::scene::samples;

    const INTRINSICS: fn() -> Intrinsics = || Intrinsics::from_fov(64, 64, 50f64.to_radians());

    fn furnished(situation: Situation) -> (Model, Target, f64) {
        let mut model = samples::object_model();
        let target = |model: &Model, choice: &RegionChoice| {
            Target::new(&model.surface(), "object", Preset::Object, choice, DVec3::Y, &INTRINSICS()).unwrap()
        };
        let alone = target(&model, &RegionChoice::default());
        let (region, limits) = situation.furnish(&mut model, alone.proxy.bounds(), alone.proxy.sphere.1, alone.region);
        let choice = RegionChoice::from(region);
        let radius = alone.proxy.sphere.1;
        (model.clone(), target(&model, &choice).within(limits).unwrap(), radius)
    }

    /// If this failed, a situation would have one name on the command line and another in tables and records, or a room want a file.
    #[cfg(feature = "cli")]
    #[test]
    fn a_situation_has_one_name_everywhere() {
        for situation in <Situation as clap::ValueEnum>::value_variants() {
            let parsed = <Situation as clap::ValueEnum>::from_str(situation.name(), false);
            assert_eq!(parsed, Ok(*situation));
            assert_eq!(serde_json::to_value(situation).unwrap(), situation.name());
            assert_eq!(situation.is_room(), situation.rooms().is_some());
        }
    }

    /// If this failed, cameras or viewers of a situation would be below its floor, behind its walls or inside its obstacles, or
    /// hardly any position would be left.
    #[test]
    fn cameras_and_viewers_stand_where_the_situation_leaves_room() {
        let mut counts = Vec::new();
        for situation in [Situation::Floor, Situation::Wall, Situation::Corner, Situation::Clutter] {
            let (model, target, radius) = furnished(situation);
            let geometry = target.geometry().unwrap();
            let low = target.region.floor.unwrap();
            let viewers = situation.viewers().sample(&geometry, INTRINSICS(), true, 3, 300).unwrap();
            let back = geometry.to_internal.inverse();
            let even = even_layout(&geometry, &Viewers::Region, 60, DQuat::IDENTITY).unwrap();
            let cameras = even.iter().map(|pose| back.point(pose.position));
            for place in viewers.iter().map(|viewer| viewer.pose.position).chain(cameras) {
                assert!(place.y >= low - 1e-9, "{situation:?}: {place} is below the floor");
                assert!(!target.limits.behind_a_wall(place), "{situation:?}: {place} is behind a wall");
                let within = |volume: &Volume| {
                    let corners = volume.triangles.iter().flatten();
                    let (min, max) = corners.fold((place, place), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
                    place.cmpgt(min).all() && place.cmplt(max).all()
                };
                assert!(!target.limits.keep_out.iter().any(within), "{situation:?}: {place} is in a thing");
            }
            // No viewer looks from farther away just because floor and walls reach so far.
            let (centre, outer) = target.region.bounding_sphere();
            let near = viewers.iter().filter(|v| v.pose.position.distance(centre) < 0.6 * outer).count();
            assert!(near > 60, "{situation:?}: {near} viewers are near");
            assert!(model.faces.len() > samples::object_model().faces.len());
            assert!(radius < outer);
            counts.push(geometry.free.free_fraction);
        }
        assert!(counts[2] < 0.75 * counts[1] && counts[1] < 0.85 * counts[0], "{counts:?}");
    }

    /// If this failed, photos from one side would be from all around, or be the same in all runs.
    #[test]
    fn photos_that_exist_are_from_one_side() {
        let (_, target, _) = furnished(Situation::OneSide);
        let geometry = target.geometry().unwrap();
        let kept = |seed| Situation::OneSide.kept(&geometry, INTRINSICS(), 20, seed).unwrap();
        let centre = target.region.bounding_sphere().0;
        let mean = |kept: &[Camera]| {
            kept.iter().map(|camera| (camera.pose.position - centre).normalize()).sum::<DVec3>() / kept.len() as f64
        };
        let (first, second) = (kept(0), kept(1));
        assert_eq!((first.len(), second.len()), (20, 20));
        assert!(mean(&first).length() > 0.6 && mean(&second).length() > 0.6);
        assert!(mean(&first).angle_between(mean(&second)) > 0.1 && mean(&first).normalize().y.abs() < 0.2);
        assert!(Situation::Floor.kept(&geometry, INTRINSICS(), 20, 0).unwrap().is_empty());
        let Viewers::Cone { axis, .. } = Situation::Front.viewers() else { panic!("the front is a cone") };
        assert_eq!(axis, DVec3::Z);
    }
}
