//! QGroundControl: a .plan of MAVLink commands, for PX4 and ArduPilot. Heights are above the place of the take-off.

use serde_json::{Value, json};

use super::flown::{Flown, Height, Photo, Place, same};
use super::georeference::Geodetic;
use super::mission::{Mission, Zone};

/// MAVLink's frames: heights above the take-off, and commands that have no place.
const RELATIVE: u32 = 3;
const NO_PLACE: u32 = 2;
/// MAVLink's commands.
const WAYPOINT: u32 = 16;
const RETURN: u32 = 20;
const TAKE_OFF: u32 = 22;
const DELAY: u32 = 93;
const MOUNT: u32 = 205;
const TAKE_PHOTO: u32 = 2000;
/// "The mount is told angles."
const MOUNT_ANGLES: f64 = 2.0;
/// Seconds at a waypoint before a photo, and for it.
const SETTLE: f64 = 2.0;
const EXPOSE: f64 = 1.0;
/// Degrees by which two of the same place may differ, a decimetre.
const SAME_DEGREES: f64 = 1e-6;
/// MAVLink's numbers of the autopilot (PX4) and the vehicle (a quadrotor).
const AUTOPILOT: u32 = 12;
const VEHICLE: u32 = 2;

/// Text of the plan.
pub fn plan(mission: &Mission) -> String {
    let mut items = Items(Vec::new());
    let Some(first) = mission.waypoints.first() else { return String::new() };
    let place = |lat: f64, lon: f64, height: f64| [json!(lat), json!(lon), json!(height)];
    // Straight up, above all that stands on the way to the first waypoint.
    let at = place(mission.home.latitude, mission.home.longitude, mission.climb);
    items.add(TAKE_OFF, RELATIVE, [json!(0), json!(0), json!(0), json!(first.heading)], at);
    for waypoint in &mission.waypoints {
        let nowhere = || [json!(0), json!(0), json!(0)];
        if waypoint.photo.is_some() {
            let mode = [json!(0), json!(0), json!(MOUNT_ANGLES)];
            items.add(MOUNT, NO_PLACE, [json!(waypoint.pitch), json!(0), json!(0), json!(0)], mode);
        }
        let hold = if waypoint.photo.is_some() { SETTLE } else { 0.0 };
        let at = place(waypoint.place.latitude, waypoint.place.longitude, waypoint.height);
        items.add(WAYPOINT, RELATIVE, [json!(hold), json!(0), json!(0), json!(waypoint.heading)], at);
        if waypoint.photo.is_some() {
            items.add(TAKE_PHOTO, NO_PLACE, [json!(0), json!(0), json!(1), json!(0)], nowhere());
            items.add(DELAY, NO_PLACE, [json!(EXPOSE), json!(-1), json!(-1), json!(-1)], nowhere());
        }
    }
    items.add(RETURN, NO_PLACE, [json!(0), json!(0), json!(0), json!(0)], [json!(0), json!(0), json!(0)]);
    let latitude_first =
        |ring: &Vec<[f64; 2]>| ring.iter().map(|[east, north]| json!([north, east])).collect::<Vec<_>>();
    let fence = |zone: &Zone| json!({ "inclusion": false, "polygon": latitude_first(&zone.ring), "version": 1 });
    let fences: Vec<Value> = mission.zones.iter().map(fence).collect();
    json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": { "circles": [], "polygons": fences, "version": 2 },
        "rallyPoints": { "points": [], "version": 2 },
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOT,
            "vehicleType": VEHICLE,
            "cruiseSpeed": mission.speed,
            "hoverSpeed": mission.speed,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [mission.home.latitude, mission.home.longitude, mission.home.altitude],
            "items": items.0
        }
    })
    .to_string()
}

struct Items(Vec<Value>);

impl Items {
    /// Adds a command with its four parameters and its place, or three parameters more.
    fn add(&mut self, command: u32, frame: u32, [a, b, c, d]: [Value; 4], [x, y, z]: [Value; 3]) {
        let mut item = json!({
            "type": "SimpleItem",
            "autoContinue": true,
            "doJumpId": self.0.len() + 1,
            "command": command,
            "frame": frame,
            "params": [a, b, c, d, x, y, z.clone()]
        });
        if frame == RELATIVE
            && let Some(item) = item.as_object_mut()
        {
            item.insert("Altitude".into(), z);
            item.insert("AltitudeMode".into(), json!(1));
            item.insert("AMSLAltAboveTerrain".into(), Value::Null);
        }
        self.0.push(item);
    }
}

/// What a plan says.
///
/// # Errors
/// In words, where it cannot be read.
pub fn read(bytes: &[u8]) -> Result<Flown, String> {
    let plan: Value = serde_json::from_slice(bytes).map_err(|e| format!("it is no JSON: {e}"))?;
    let numbers = |value: &Value, what: &str| -> Result<Vec<f64>, String> {
        let list = value.as_array().ok_or(format!("it has no {what}"))?;
        // QGroundControl writes null where a command has nothing to say; what should be there is missed below.
        let number = |number: &Value| if number.is_null() { Some(0.0) } else { number.as_f64() };
        list.iter().map(|value| number(value).ok_or(format!("a number of {what} is {value}"))).collect()
    };
    let mission = &plan["mission"];
    let mut flown = Flown { speed: mission["cruiseSpeed"].as_f64(), ..Flown::default() };
    flown.require(same(&mission["hoverSpeed"], &mission["cruiseSpeed"]), || "its two speeds differ".into());
    match numbers(&mission["plannedHomePosition"], "plannedHomePosition")?[..] {
        [latitude, longitude, altitude] => flown.home = Some(Geodetic { latitude, longitude, altitude }),
        _ => return Err("its plannedHomePosition is not three numbers".into()),
    }
    let fences = plan["geoFence"]["polygons"].as_array().ok_or("it has no geofence")?;
    let mut zones = Vec::new();
    for fence in fences {
        flown.require(fence["inclusion"] == false, || "an area of its geofence is to be flown in".into());
        let corners = fence["polygon"].as_array().ok_or("an area of its geofence has no polygon")?;
        let corner = |corner: &Value| match numbers(corner, "geofence")?[..] {
            [north, east] => Ok([east, north]),
            _ => Err("a corner of its geofence is not two numbers".to_owned()),
        };
        zones.push(corners.iter().map(corner).collect::<Result<Vec<_>, String>>()?);
    }
    flown.zones = Some(zones);
    let items = mission["items"].as_array().ok_or("it has no items")?;
    let (mut heading, mut pitch) = (0.0, None);
    for (i, item) in items.iter().enumerate() {
        let says = |what: String| format!("item {}: {what}", i + 1);
        let [a, _, _, d, x, y, z] = numbers(&item["params"], "params").map_err(says)?[..] else {
            return Err(says("it has not seven params".into()));
        };
        flown.require(item["doJumpId"].as_f64() == Some((i + 1) as f64), || says("its doJumpId is another".into()));
        let command = item["command"].as_f64().unwrap_or_default() as u32;
        let first = i == 0;
        flown.require(first == (command == TAKE_OFF), || says("only the first item is a take-off".into()));
        flown
            .require((i + 1 == items.len()) == (command == RETURN), || says("only the last item is the return".into()));
        match command {
            TAKE_OFF | WAYPOINT => {
                flown.require(
                    item["frame"].as_f64() == Some(f64::from(RELATIVE)) && item["AltitudeMode"].as_f64() == Some(1.0),
                    || says("its altitude is not above the take-off".into()),
                );
                flown.require(item["Altitude"].as_f64() == Some(z), || says("its two altitudes differ".into()));
                let place = Place { latitude: x, longitude: y, height: Height::AboveTakeoff(z) };
                if command == WAYPOINT {
                    flown.way.push(place);
                    heading = d;
                } else {
                    let home = flown.home.map_or([x, y], |home| [home.latitude, home.longitude]);
                    let there = (x - home[0]).abs().max((y - home[1]).abs()) < SAME_DEGREES;
                    flown.require(there, || says("the take-off is not at the planned home".into()));
                    flown.climb = Some(z);
                }
            }
            MOUNT => pitch = Some(a),
            TAKE_PHOTO => match (flown.way.last().copied(), pitch.take()) {
                (Some(place), Some(pitch)) => flown.photos.push(Photo { place, heading, pitch }),
                _ => flown.faults.push(says("the gimbal is not turned for its photo".into())),
            },
            RETURN | DELAY => {}
            other => flown.faults.push(says(format!("command {other} is none of a mission"))),
        }
    }
    Ok(flown)
}
