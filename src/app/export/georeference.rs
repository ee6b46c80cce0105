//! Where a scene lies on Earth.

use geodesy::prelude::*;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use crate::scene::similarity::Similarity;
use crate::{Error, Result};

/// Photos with a position that a scene is fitted to at least.
const FEWEST: usize = 4;
/// A photo counts in the fit if it is off by less than so many times what the median photo is off by.
const OUTLIER: f64 = 3.0;
/// Rounds of leaving outliers out.
const ROUNDS: usize = 5;
/// Length in metres over which the directions of a map's grid are measured.
const BASELINE: f64 = 100.0;

/// A place on Earth (WGS 84).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
    /// Metres, above the ellipsoid or above the sea, as whoever gave the place measures.
    pub altitude: f64,
}

impl Geodetic {
    /// The place itself.
    ///
    /// # Errors
    /// Where it is not on Earth.
    pub fn validated(self) -> Result<Self> {
        let Self { latitude, longitude, altitude } = self;
        let valid = latitude.abs() < 89.9 && longitude.abs() <= 180.0 && altitude.abs() < 1e5;
        if valid { Ok(self) } else { Err(Error::request(format!("`geo`: there is no place at {self}"))) }
    }
}

impl std::fmt::Display for Geodetic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.7}, {:.7}, {:.2} m", self.latitude, self.longitude, self.altitude)
    }
}

/// The map from a scene to Earth: a similarity to metres east, north and up of an anchor. It takes Earth for a plane there only to turn
/// directions; places are exact but for what a map grid bends, a decimetre in a kilometre.
#[derive(Debug)]
pub struct Georeference {
    to_metres: Similarity,
    anchor: Geodetic,
    earth: Earth,
}

/// What a fit to positions of photos is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Photos that count.
    pub used: usize,
    /// Photos that have a position.
    pub photos: usize,
    /// Root mean square of what those that count are off by, in metres.
    pub rms: f64,
}

impl Georeference {
    /// The scene's origin is at `anchor` and its lengths are metres; its north (see [`north_of`]) points `heading` degrees clockwise from
    /// true north.
    ///
    /// # Errors
    /// Where there is no such place.
    pub fn anchored(anchor: Geodetic, heading: f64, up: DVec3) -> Result<Self> {
        let anchor = anchor.validated()?;
        if !heading.is_finite() {
            return Err(Error::request(format!("`geo`: the heading is {heading}; give degrees clockwise from north")));
        }
        let north = north_of(up);
        let to_upright = DMat3::from_cols(north.cross(up), north, up).transpose();
        let turn = DQuat::from_rotation_z(-heading.to_radians());
        let rotation = (turn * DQuat::from_mat3(&to_upright)).normalize();
        let to_metres = Similarity { rotation, scale: 1.0, translation: DVec3::ZERO };
        Ok(Self { to_metres, anchor, earth: Earth::new()? })
    }

    /// The scene's coordinates are east, north and height in metres in a UTM zone ("33N", "56S") less `offset`. `near` is a place of the
    /// scene, around which the map is best.
    ///
    /// # Errors
    /// Where there is no such zone, or the place is not in it.
    pub fn utm(zone: &str, offset: DVec3, near: DVec3) -> Result<Self> {
        let wrong = || Error::request(format!("`geo`: {zone:?} is no UTM zone; give one such as 33N or 56S"));
        let (number, south) = match zone.strip_suffix(['N', 'n']) {
            Some(number) => (number, false),
            None => (zone.strip_suffix(['S', 's']).ok_or_else(wrong)?, true),
        };
        let number: u32 = number.parse().ok().filter(|number| (1..=60).contains(number)).ok_or_else(wrong)?;
        let mut earth = Earth::new()?;
        let map = earth.operator(&format!("utm zone={number} ellps=WGS84{}", if south { " south" } else { "" }))?;
        let place = |p: DVec3| {
            let grid = p + offset;
            let outside = !(100_000.0..900_000.0).contains(&grid.x) || !(0.0..10_000_000.0).contains(&grid.y);
            let place = earth.transformed(map, Inv, Coor4D::raw(grid.x, grid.y, 0.0, 0.0));
            let place = place.map(|place| geodetic(&place, grid.z)).and_then(Geodetic::validated);
            if outside || place.is_err() {
                return Err(Error::request(format!(
                    "`geo`: ({:.1}, {:.1}) is not in a UTM zone; give what is to be added to east and north",
                    grid.x, grid.y
                )));
            }
            place
        };
        let anchor = place(near)?;
        let [east, north] = [DVec3::X, DVec3::Y].map(|axis| place(near + BASELINE * axis));
        let level = |p: Geodetic| Geodetic { altitude: anchor.altitude, ..p };
        let east = earth.metres(&anchor, &level(east?))? / BASELINE;
        let north = earth.metres(&anchor, &level(north?))? / BASELINE;
        // The grid's convergence, and its scale.
        let angle = (east.y - north.x).atan2(east.x + north.y);
        let scale = 0.5 * (east.truncate().length() + north.truncate().length());
        let rotation = DQuat::from_rotation_z(angle);
        Ok(Self { to_metres: Similarity { rotation, scale, translation: -scale * (rotation * near) }, anchor, earth })
    }

    /// The scene's coordinates are geocentric, in metres; `near` as in [`Self::utm`].
    ///
    /// # Errors
    /// Where the place is not near Earth's surface.
    pub fn geocentric(near: DVec3) -> Result<Self> {
        let earth = Earth::new()?;
        let anchor = earth.place(near)?.validated()?;
        let rotation = DQuat::from_mat3(&axes(&anchor).transpose()).normalize();
        Ok(Self { to_metres: Similarity { rotation, scale: 1.0, translation: -(rotation * near) }, anchor, earth })
    }

    /// The similarity that brings photos of a scene nearest to where their positions on Earth say they were taken, in the sense of least
    /// squares without outliers (the closed form of Horn, 1987).
    ///
    /// # Errors
    /// For fewer than four photos, or such that lie on a line or at one place.
    pub fn fitted(photos: &[DVec3], positions: &[Geodetic]) -> Result<(Self, Fit)> {
        let count = photos.len().min(positions.len());
        if count < FEWEST {
            return Err(Error::request(format!(
                "`geo`: {count} photos have GPS positions; {FEWEST} are needed, or give LAT,LON,ALT instead"
            )));
        }
        let mean = |get: fn(&Geodetic) -> f64| positions[..count].iter().map(get).sum::<f64>() / count as f64;
        let anchor = Geodetic {
            latitude: mean(|p| p.latitude),
            longitude: mean(|p| p.longitude),
            altitude: mean(|p| p.altitude),
        };
        let (anchor, earth) = (anchor.validated()?, Earth::new()?);
        let metres: Vec<DVec3> = positions[..count].iter().map(|p| earth.metres(&anchor, p)).collect::<Result<_>>()?;
        let mut counted: Vec<usize> = (0..count).collect();
        let mut fitted = similarity(photos, &metres, &counted)?;
        for _ in 0..ROUNDS {
            let off = |i: usize| fitted.point(photos[i]).distance(metres[i]);
            let mut sorted: Vec<f64> = (0..count).map(off).collect();
            sorted.sort_by(f64::total_cmp);
            let limit = (OUTLIER * sorted[count / 2]).max(f64::MIN_POSITIVE);
            let near: Vec<usize> = (0..count).filter(|i| off(*i) <= limit).collect();
            if near.len() < FEWEST || near == counted {
                break;
            }
            counted = near;
            fitted = similarity(photos, &metres, &counted)?;
        }
        let squares = counted.iter().map(|i| fitted.point(photos[*i]).distance_squared(metres[*i])).sum::<f64>();
        let rms = (squares / counted.len() as f64).sqrt();
        Ok((Self { to_metres: fitted, anchor, earth }, Fit { used: counted.len(), photos: count, rms }))
    }

    /// Metres in one unit of the scene.
    pub fn scale(&self) -> f64 {
        self.to_metres.scale
    }

    /// Where a place of the scene is.
    ///
    /// # Errors
    /// Where it is not on Earth.
    pub fn place(&self, p: DVec3) -> Result<Geodetic> {
        let centre = self.earth.geocentric(&self.anchor)?;
        self.earth.place(centre + axes(&self.anchor) * self.to_metres.point(p))?.validated()
    }

    /// The point of the scene at a place on Earth.
    ///
    /// # Errors
    /// Where there is no such place.
    pub fn scene_point(&self, place: &Geodetic) -> Result<DVec3> {
        Ok(self.to_metres.inverse().point(self.earth.metres(&self.anchor, &place.validated()?)?))
    }

    /// The unit direction of the scene that points up on Earth.
    pub fn up(&self) -> DVec3 {
        self.to_metres.inverse().direction(DVec3::Z)
    }

    /// Where a direction of the scene points: degrees clockwise from true north in [0, 360), and degrees above the horizon.
    pub fn heading_and_pitch(&self, direction: DVec3) -> (f64, f64) {
        let d = self.to_metres.direction(direction);
        let heading = d.x.atan2(d.y).to_degrees().rem_euclid(360.0);
        (heading, d.z.atan2(d.x.hypot(d.y)).to_degrees())
    }
}

/// The direction of a scene that is north where it is laid out by an anchor: +Y, or -Z where Y is up, as far as it is level.
pub fn north_of(up: DVec3) -> DVec3 {
    let axis = if up.abs().max_position() == 1 { DVec3::NEG_Z } else { DVec3::Y };
    (axis - axis.dot(up) * up).normalize()
}

/// Transformations of coordinates.
#[derive(Debug)]
struct Earth {
    context: Minimal,
    to_geocentric: OpHandle,
}

impl Earth {
    fn new() -> Result<Self> {
        let mut context = Minimal::new();
        let to_geocentric = context.op("cart ellps=WGS84").map_err(|e| failed(&e))?;
        Ok(Self { context, to_geocentric })
    }

    fn operator(&mut self, definition: &str) -> Result<OpHandle> {
        self.context.op(definition).map_err(|e| failed(&e))
    }

    fn transformed(&self, operator: OpHandle, direction: Direction, coordinates: Coor4D) -> Result<Coor4D> {
        let mut data = [coordinates];
        self.context.apply(operator, direction, &mut data).map_err(|e| failed(&e))?;
        Ok(data[0])
    }

    /// Geocentric coordinates of a place, in metres.
    fn geocentric(&self, place: &Geodetic) -> Result<DVec3> {
        let radians = Coor4D::geo(place.latitude, place.longitude, place.altitude, 0.0);
        let (x, y, z) = self.transformed(self.to_geocentric, Fwd, radians)?.xyz();
        Ok(DVec3::new(x, y, z))
    }

    /// The place at geocentric coordinates.
    fn place(&self, p: DVec3) -> Result<Geodetic> {
        let place = self.transformed(self.to_geocentric, Inv, Coor4D::raw(p.x, p.y, p.z, 0.0))?;
        Ok(geodetic(&place, place.z()))
    }

    /// From an anchor to a place, in metres east, north and up of the anchor.
    fn metres(&self, anchor: &Geodetic, place: &Geodetic) -> Result<DVec3> {
        Ok(axes(anchor).transpose() * (self.geocentric(place)? - self.geocentric(anchor)?))
    }
}

fn geodetic(radians: &Coor4D, altitude: f64) -> Geodetic {
    let (longitude, latitude) = radians.xy_to_degrees();
    Geodetic { latitude, longitude, altitude }
}

fn failed(error: &geodesy::Error) -> Error {
    Error::request(format!("`geo`: {error}"))
}

/// Unit vectors east, north and up at a place, in geocentric coordinates.
fn axes(place: &Geodetic) -> DMat3 {
    let (sin_lat, cos_lat) = place.latitude.to_radians().sin_cos();
    let (sin_lon, cos_lon) = place.longitude.to_radians().sin_cos();
    DMat3::from_cols(
        DVec3::new(-sin_lon, cos_lon, 0.0),
        DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
        DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat),
    )
}

/// The least-squares similarity from points to others.
fn similarity(from: &[DVec3], to: &[DVec3], counted: &[usize]) -> Result<Similarity> {
    let mean = |points: &[DVec3]| counted.iter().map(|i| points[*i]).sum::<DVec3>() / counted.len() as f64;
    let (middle_from, middle_to) = (mean(from), mean(to));
    let (mut products, mut spread_from, mut spread_to) = (DMat3::ZERO, 0.0, 0.0);
    for i in counted {
        let (a, b) = (from[*i] - middle_from, to[*i] - middle_to);
        products += DMat3::from_cols(a.x * b, a.y * b, a.z * b);
        (spread_from, spread_to) = (spread_from + a.length_squared(), spread_to + b.length_squared());
    }
    let rotation = rotation(&products).ok_or_else(|| {
        Error::request("`geo`: the photos lie on a line or at one place, so that nothing tells how the scene is turned; give LAT,LON,ALT")
    })?;
    let scale = (spread_to / spread_from).sqrt();
    Ok(Similarity { rotation, scale, translation: middle_to - scale * (rotation * middle_from) })
}

/// The rotation R that makes the trace of R times the products of all pairs (`sum b a^T`) greatest: the first eigenvector of Horn's matrix,
/// by squaring it until nothing else is left; none where it is not unique.
fn rotation(products: &DMat3) -> Option<DQuat> {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = products.to_cols_array_2d();
    let trace = xx + yy + zz;
    let mut power = DMat4::from_cols(
        DVec4::new(trace, yz - zy, zx - xz, xy - yx),
        DVec4::new(yz - zy, xx - yy - zz, xy + yx, zx + xz),
        DVec4::new(zx - xz, xy + yx, yy - xx - zz, yz + zy),
        DVec4::new(xy - yx, zx + xz, yz + zy, zz - xx - yy),
    );
    let size = |m: &DMat4| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
    let first = size(&power);
    if !(first > 0.0 && first.is_finite()) {
        return None;
    }
    // No eigenvalue is below zero then, so that the greatest one counts most.
    power = power * (1.0 / first) + DMat4::IDENTITY;
    for _ in 0..20 {
        power = power * power;
        power = power * (1.0 / size(&power));
    }
    let trace = (0..4).map(|i| power.col(i)[i]).sum::<f64>();
    if (trace - 1.0).abs() > 1e-3 {
        return None;
    }
    let column = (0..4).map(|i| power.col(i)).max_by(|a, b| a.length().total_cmp(&b.length()))?.normalize();
    Some(DQuat::from_xyzw(column.y, column.z, column.w, column.x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    const BERLIN: Geodetic = Geodetic { latitude: 52.5163, longitude: 13.3777, altitude: 34.0 };

    /// Metres in a degree of latitude, and of longitude at a latitude (series of the meridian's and the parallel's arc, WGS 84).
    fn metres_in_a_degree(latitude: f64) -> (f64, f64) {
        let of = |k: f64| (k * latitude.to_radians()).cos();
        (111_132.954 - 559.822 * of(2.0) + 1.175 * of(4.0), 111_412.84 * of(1.0) - 93.5 * of(3.0) + 0.118 * of(5.0))
    }

    /// If this failed, a drone would fly beside the plan or turn away from the object: metres become degrees as the arcs of Earth have it,
    /// with the scene's north where the heading says, whatever axis is up.
    #[test]
    fn an_anchored_scene_lies_where_its_heading_says() {
        let (by_latitude, by_longitude) = metres_in_a_degree(BERLIN.latitude);
        for (up, north) in
            [(DVec3::Z, DVec3::Y), (DVec3::Y, DVec3::NEG_Z), (DVec3::X, DVec3::Y), (DVec3::NEG_Z, DVec3::Y)]
        {
            for heading in [0.0, 90.0, 213.0] {
                let scene = Georeference::anchored(BERLIN, heading, up).unwrap();
                let ahead = scene.place(50.0 * north + 7.0 * up).unwrap();
                let (sin, cos) = f64::to_radians(heading).sin_cos();
                let off = DVec3::new(
                    (ahead.longitude - BERLIN.longitude) * by_longitude - 50.0 * sin,
                    (ahead.latitude - BERLIN.latitude) * by_latitude - 50.0 * cos,
                    ahead.altitude - BERLIN.altitude - 7.0,
                );
                assert!(off.length() < 2e-3, "{off} with {up} up at {heading}");
                let (turned, pitch) = scene.heading_and_pitch(north - up);
                assert!((turned - heading).abs() < 1e-6 && (pitch + 45.0).abs() < 1e-9, "{turned} {pitch}");
                let right = north.cross(up);
                let east = scene.heading_and_pitch(right).0;
                assert!(
                    (east - (heading + 90.0).rem_euclid(360.0)).abs() < 1e-6,
                    "{east} is not to the right of {heading}"
                );
            }
        }
    }

    /// If this failed, georeferenced clouds would be planned elsewhere: published UTM coordinates come out at their place, on both sides of
    /// the equator, and the grid's north is turned from true north by the convergence.
    #[test]
    fn utm_coordinates_are_found() {
        // The Brandenburg Gate, and the Sydney Opera House.
        let gate = DVec3::new(389_906.0, 5_819_705.0, 34.0);
        let scene = Georeference::utm("33N", gate, DVec3::ZERO).unwrap();
        let place = scene.place(DVec3::ZERO).unwrap();
        assert!((place.latitude - 52.5163).abs() < 2e-4 && (place.longitude - 13.3777).abs() < 2e-4, "{place}");
        // The convergence is the difference to the central meridian (15 degrees) times the sine of the latitude.
        let convergence = (place.longitude - 15.0) * place.latitude.to_radians().sin();
        let (heading, _) = scene.heading_and_pitch(DVec3::Y);
        let turned = (heading + 180.0).rem_euclid(360.0) - 180.0;
        assert!((turned - convergence).abs() < 0.01, "{turned} for {convergence}");
        assert!((scene.place(DVec3::new(0.0, 0.0, 12.0)).unwrap().altitude - 46.0).abs() < 0.01);
        let opera = Georeference::utm("56s", DVec3::ZERO, DVec3::new(334_873.0, 6_252_266.0, 4.0)).unwrap();
        let place = opera.place(DVec3::new(334_873.0, 6_252_266.0, 4.0)).unwrap();
        assert!((place.latitude + 33.8568).abs() < 5e-4 && (place.longitude - 151.2153).abs() < 5e-4, "{place}");
        for (zone, near) in [("61N", gate), ("33", gate), ("33N", DVec3::ZERO), ("-1N", gate), ("33N", DVec3::NAN)] {
            assert!(Georeference::utm(zone, DVec3::ZERO, near).is_err(), "{zone} at {near}");
        }
    }

    /// If this failed, geocentric models would be planned elsewhere, or turned.
    #[test]
    fn geocentric_coordinates_are_found() {
        let earth = Earth::new().unwrap();
        let near = earth.geocentric(&BERLIN).unwrap();
        let scene = Georeference::geocentric(near).unwrap();
        let [east, north, up] = [0, 1, 2].map(|i| axes(&BERLIN).col(i));
        let above = scene.place(near + 20.0 * up).unwrap();
        assert!((above.altitude - 54.0).abs() < 1e-6 && (above.latitude - BERLIN.latitude).abs() < 1e-9, "{above}");
        assert!((scene.heading_and_pitch(east).0 - 90.0).abs() < 1e-9 && scene.heading_and_pitch(north + up).1 > 44.9);
        assert!(Georeference::geocentric(DVec3::ONE).is_err());
    }

    /// If this failed, photos with GPS would place the scene wrongly: a scene of any scale and turn is found again from positions that are
    /// a metre off, although one in eight is far off.
    #[test]
    fn a_scene_is_fitted_to_gps_with_outliers() {
        let truth = Georeference::anchored(BERLIN, 37.0, DVec3::Z).unwrap();
        let hidden = Similarity {
            rotation: DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 2.0),
            scale: 0.13,
            translation: DVec3::new(3.0, -1.0, 2.0),
        };
        let noise = |i: u32, stream: u32| DVec3::from_slice(&random::uniforms(4, stream, i)) - 0.5;
        let metres: Vec<DVec3> = (0..40).map(|i| 60.0 * noise(i, 0)).collect();
        let photos: Vec<DVec3> = metres.iter().map(|p| hidden.point(*p)).collect();
        let measured: Vec<Geodetic> = (0..40u32)
            .zip(&metres)
            .map(|(i, p)| {
                truth.place(*p + noise(i, 1) + if i % 8 == 3 { 400.0 * noise(i, 2) } else { DVec3::ZERO }).unwrap()
            })
            .collect();
        let (found, fit) = Georeference::fitted(&photos, &measured).unwrap();
        assert!((30..=35).contains(&fit.used) && fit.photos == 40 && fit.rms < 0.8, "{fit:?}");
        assert!((found.scale() - 1.0 / 0.13).abs() < 0.02 / 0.13, "{}", found.scale());
        for (p, photo) in metres.iter().zip(&photos) {
            let (a, b) = (truth.place(*p).unwrap(), found.place(*photo).unwrap());
            assert!(truth.earth.metres(&a, &b).unwrap().length() < 1.0, "{a} and {b}");
        }
        let along = hidden.direction(DVec3::new(1.0, 2.0, -0.5));
        let (heading, pitch) = found.heading_and_pitch(along);
        let (true_heading, true_pitch) = truth.heading_and_pitch(DVec3::new(1.0, 2.0, -0.5));
        assert!((heading - true_heading).abs() < 1.0 && (pitch - true_pitch).abs() < 1.0, "{heading} {pitch}");
        let line: Vec<DVec3> = (0..6).map(|i| f64::from(i) * DVec3::X).collect();
        let on_a_line: Vec<Geodetic> = line.iter().map(|p| truth.place(*p).unwrap()).collect();
        assert!(Georeference::fitted(&line, &on_a_line).is_err(), "photos on a line tell no turn");
        assert!(Georeference::fitted(&photos[..3], &measured[..3]).is_err());
    }
}
