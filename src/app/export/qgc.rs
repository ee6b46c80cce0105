//! QGroundControl: a .plan of MAVLink commands, for PX4 and ArduPilot. Heights are above the place of the take-off.

use serde_json::{Value, json};

use super::mission::Mission;

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
/// MAVLink's numbers of the autopilot (PX4) and the vehicle (a quadrotor).
const AUTOPILOT: u32 = 12;
const VEHICLE: u32 = 2;

/// Text of the plan.
pub fn plan(mission: &Mission) -> String {
    let mut items = Items(Vec::new());
    let Some(first) = mission.waypoints.first() else { return String::new() };
    let place = |lat: f64, lon: f64, height: f64| [json!(lat), json!(lon), json!(height)];
    let at = place(first.place.latitude, first.place.longitude, first.height);
    items.add(TAKE_OFF, RELATIVE, [json!(0), json!(0), json!(0), Value::Null], at);
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
    let empty = || json!({ "circles": [], "polygons": [], "version": 2 });
    json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": empty(),
        "rallyPoints": { "points": [], "version": 2 },
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOT,
            "vehicleType": VEHICLE,
            "cruiseSpeed": mission.speed,
            "hoverSpeed": mission.speed,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [first.place.latitude, first.place.longitude, mission.takeoff],
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
