//! DJI: a mission in WPML, packed as KMZ with the template that Pilot 2 edits and the waylines that the drone flies.
//!
//! Elements and values are those of DJI's own description of WPML 1.0.2 (Cloud API, "DJI WPML"). The drone is said to be a Mavic 3E; apps for
//! other models ask, or take another number in `droneInfo`.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::flown::{Flown, Height, Photo, Place, number};
use super::mission::{Mission, Waypoint};
use super::written::unpacked;
use crate::files::io::xml;
use crate::{Error, Result};

/// DJI's numbers of the Mavic 3E and of its camera.
const DRONE: u32 = 77;
const PAYLOAD: u32 = 66;

/// Bytes of the .kmz.
///
/// # Errors
/// Never in practice: where the archive cannot be written.
pub fn kmz(mission: &Mission) -> Result<Vec<u8>> {
    let failed = |what: String| Error::request(format!("the mission cannot be packed: {what}"));
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // No compression and no time, so that the same mission gives the same bytes.
    let plain = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, text) in [("wpmz/template.kml", template(mission)), ("wpmz/waylines.wpml", waylines(mission))] {
        archive.start_file(name, plain).map_err(|e| failed(e.to_string()))?;
        archive.write_all(text.as_bytes()).map_err(|e| failed(e.to_string()))?;
    }
    Ok(archive.finish().map_err(|e| failed(e.to_string()))?.into_inner())
}

/// What an app edits.
fn template(mission: &Mission) -> String {
    let mut text = head(mission);
    let speed = mission.speed;
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "<Folder>\n<wpml:templateType>waypoint</wpml:templateType>\n<wpml:templateId>0</wpml:templateId>\n\
         <wpml:waylineCoordinateSysParam>\n<wpml:coordinateMode>WGS84</wpml:coordinateMode>\n\
         <wpml:heightMode>relativeToStartPoint</wpml:heightMode>\n<wpml:positioningType>GPS</wpml:positioningType>\n\
         </wpml:waylineCoordinateSysParam>\n<wpml:autoFlightSpeed>{speed:.1}</wpml:autoFlightSpeed>\n\
         <wpml:gimbalPitchMode>usePointSetting</wpml:gimbalPitchMode>\n<wpml:globalHeight>{:.2}</wpml:globalHeight>\n\
         <wpml:globalWaypointHeadingParam>\n<wpml:waypointHeadingMode>smoothTransition</wpml:waypointHeadingMode>\n\
         <wpml:waypointHeadingAngle>0</wpml:waypointHeadingAngle>\n\
         <wpml:waypointHeadingPathMode>followBadArc</wpml:waypointHeadingPathMode>\n</wpml:globalWaypointHeadingParam>\n\
         <wpml:globalWaypointTurnMode>toPointAndStopWithDiscontinuityCurvature</wpml:globalWaypointTurnMode>\n\
         <wpml:globalUseStraightLine>1</wpml:globalUseStraightLine>\n",
        mission.waypoints.first().map_or(0.0, |first| first.height)
    );
    for (i, waypoint) in mission.waypoints.iter().enumerate() {
        placemark(&mut text, i, waypoint, |text| {
            let _ = write!(
                text,
                "<wpml:ellipsoidHeight>{0:.2}</wpml:ellipsoidHeight>\n<wpml:height>{0:.2}</wpml:height>\n\
                 <wpml:useGlobalHeight>0</wpml:useGlobalHeight>\n<wpml:useGlobalSpeed>1</wpml:useGlobalSpeed>\n\
                 <wpml:useGlobalHeadingParam>0</wpml:useGlobalHeadingParam>\n<wpml:useGlobalTurnParam>1</wpml:useGlobalTurnParam>\n\
                 <wpml:gimbalPitchAngle>{1:.1}</wpml:gimbalPitchAngle>\n",
                waypoint.height, waypoint.pitch
            );
        });
    }
    text + "</Folder>\n</Document>\n</kml>\n"
}

/// What the drone flies.
fn waylines(mission: &Mission) -> String {
    let mut text = head(mission);
    let speed = mission.speed;
    let _ = write!(
        text,
        "<Folder>\n<wpml:templateId>0</wpml:templateId>\n<wpml:executeHeightMode>relativeToStartPoint</wpml:executeHeightMode>\n\
         <wpml:waylineId>0</wpml:waylineId>\n<wpml:autoFlightSpeed>{speed:.1}</wpml:autoFlightSpeed>\n"
    );
    for (i, waypoint) in mission.waypoints.iter().enumerate() {
        placemark(&mut text, i, waypoint, |text| {
            let _ = write!(
                text,
                "<wpml:executeHeight>{:.2}</wpml:executeHeight>\n<wpml:waypointSpeed>{speed:.1}</wpml:waypointSpeed>\n\
                 <wpml:waypointTurnParam>\n\
                 <wpml:waypointTurnMode>toPointAndStopWithDiscontinuityCurvature</wpml:waypointTurnMode>\n\
                 <wpml:waypointTurnDampingDist>0</wpml:waypointTurnDampingDist>\n</wpml:waypointTurnParam>\n\
                 <wpml:useStraightLine>1</wpml:useStraightLine>\n",
                waypoint.height
            );
        });
    }
    text + "</Folder>\n</Document>\n</kml>\n"
}

/// Both files up to their folder.
fn head(mission: &Mission) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\" \
         xmlns:wpml=\"http://www.dji.com/wpmz/1.0.2\">\n<Document>\n<wpml:missionConfig>\n\
         <wpml:flyToWaylineMode>safely</wpml:flyToWaylineMode>\n<wpml:finishAction>goHome</wpml:finishAction>\n\
         <wpml:exitOnRCLost>executeLostAction</wpml:exitOnRCLost>\n<wpml:executeRCLostAction>goBack</wpml:executeRCLostAction>\n\
         <wpml:takeOffSecurityHeight>{:.0}</wpml:takeOffSecurityHeight>\n\
         <wpml:globalTransitionalSpeed>{:.1}</wpml:globalTransitionalSpeed>\n\
         <wpml:droneInfo>\n<wpml:droneEnumValue>{DRONE}</wpml:droneEnumValue>\n<wpml:droneSubEnumValue>0</wpml:droneSubEnumValue>\n\
         </wpml:droneInfo>\n<wpml:payloadInfo>\n<wpml:payloadEnumValue>{PAYLOAD}</wpml:payloadEnumValue>\n\
         <wpml:payloadPositionIndex>0</wpml:payloadPositionIndex>\n</wpml:payloadInfo>\n</wpml:missionConfig>\n",
        mission.climb.ceil(),
        mission.speed
    )
}

/// A waypoint, with what only one of the files has.
fn placemark(text: &mut String, i: usize, waypoint: &Waypoint, own: impl Fn(&mut String)) {
    let _ = write!(
        text,
        "<Placemark>\n<Point>\n<coordinates>{:.8},{:.8}</coordinates>\n</Point>\n<wpml:index>{i}</wpml:index>\n",
        waypoint.place.longitude, waypoint.place.latitude
    );
    own(text);
    // From -180 to 180, in whole degrees.
    let heading = (waypoint.heading.round() + 180.0).rem_euclid(360.0) - 180.0;
    let _ = write!(
        text,
        "<wpml:waypointHeadingParam>\n<wpml:waypointHeadingMode>smoothTransition</wpml:waypointHeadingMode>\n\
         <wpml:waypointHeadingAngle>{heading:.0}</wpml:waypointHeadingAngle>\n\
         <wpml:waypointHeadingPathMode>followBadArc</wpml:waypointHeadingPathMode>\n</wpml:waypointHeadingParam>\n"
    );
    if waypoint.photo.is_some() {
        let _ = write!(
            text,
            "<wpml:actionGroup>\n<wpml:actionGroupId>{i}</wpml:actionGroupId>\n\
             <wpml:actionGroupStartIndex>{i}</wpml:actionGroupStartIndex>\n<wpml:actionGroupEndIndex>{i}</wpml:actionGroupEndIndex>\n\
             <wpml:actionGroupMode>sequence</wpml:actionGroupMode>\n<wpml:actionTrigger>\n\
             <wpml:actionTriggerType>reachPoint</wpml:actionTriggerType>\n</wpml:actionTrigger>\n"
        );
        action(
            text,
            0,
            "gimbalRotate",
            &format!(
                "<wpml:gimbalHeadingYawBase>north</wpml:gimbalHeadingYawBase>\n<wpml:gimbalRotateMode>absoluteAngle</wpml:gimbalRotateMode>\n\
                 <wpml:gimbalPitchRotateEnable>1</wpml:gimbalPitchRotateEnable>\n\
                 <wpml:gimbalPitchRotateAngle>{:.1}</wpml:gimbalPitchRotateAngle>\n\
                 <wpml:gimbalRollRotateEnable>0</wpml:gimbalRollRotateEnable>\n<wpml:gimbalRollRotateAngle>0</wpml:gimbalRollRotateAngle>\n\
                 <wpml:gimbalYawRotateEnable>0</wpml:gimbalYawRotateEnable>\n<wpml:gimbalYawRotateAngle>0</wpml:gimbalYawRotateAngle>\n\
                 <wpml:gimbalRotateTimeEnable>0</wpml:gimbalRotateTimeEnable>\n<wpml:gimbalRotateTime>0</wpml:gimbalRotateTime>\n",
                waypoint.pitch
            ),
        );
        action(
            text,
            1,
            "takePhoto",
            &format!(
                "<wpml:fileSuffix>{i:04}</wpml:fileSuffix>\n<wpml:useGlobalPayloadLensIndex>1</wpml:useGlobalPayloadLensIndex>\n"
            ),
        );
        text.push_str("</wpml:actionGroup>\n");
    }
    text.push_str("</Placemark>\n");
}

fn action(text: &mut String, id: u32, name: &str, parameters: &str) {
    let _ = write!(
        text,
        "<wpml:action>\n<wpml:actionId>{id}</wpml:actionId>\n<wpml:actionActuatorFunc>{name}</wpml:actionActuatorFunc>\n\
         <wpml:actionActuatorFuncParam>\n{parameters}<wpml:payloadPositionIndex>0</wpml:payloadPositionIndex>\n\
         </wpml:actionActuatorFuncParam>\n</wpml:action>\n"
    );
}

/// What a mission says: its waylines, which the drone flies, with which the template has to agree.
///
/// # Errors
/// In words, where it cannot be read.
pub fn read(bytes: &[u8]) -> Result<Flown, String> {
    let file = |name: &str, height: &str, mode: &str| {
        read_file(&unpacked(bytes, name)?, height, mode).map_err(|e| format!("{name}: {e}"))
    };
    let mut flown = file("wpmz/waylines.wpml", "executeHeight", "executeHeightMode")?;
    let template = file("wpmz/template.kml", "height", "heightMode")?;
    flown.require(template == Flown { faults: template.faults.clone(), ..flown.clone() }, || {
        "its template says another flight than its waylines".into()
    });
    flown.faults.extend(template.faults);
    Ok(flown)
}

fn read_file(text: &str, height_name: &str, mode: &str) -> Result<Flown, String> {
    let document = xml::document(text).map_err(|e| format!("it is no XML: {e}"))?;
    let inner = |node: roxmltree::Node<'_, '_>, name: &str| -> Result<String, String> {
        let found = node.descendants().find(|inner| inner.tag_name().name() == name);
        found.and_then(|found| found.text().map(str::to_owned)).ok_or(format!("it has no {name}"))
    };
    let root = document.root();
    let of = |node, name: &str| inner(node, name).and_then(|text| number(&text).map_err(|e| format!("{name}: {e}")));
    let mut flown = Flown {
        speed: Some(of(root, "autoFlightSpeed")?),
        climb: Some(of(root, "takeOffSecurityHeight")?),
        ..Flown::default()
    };
    flown.require(inner(root, mode)? == "relativeToStartPoint", || "its heights are not above the take-off".into());
    for (i, mark) in document.descendants().filter(|node| node.tag_name().name() == "Placemark").enumerate() {
        let coordinates = inner(mark, "coordinates")?;
        let [longitude, latitude, ..] = coordinates.split(',').map(number).collect::<Result<Vec<_>, _>>()?[..] else {
            return Err(format!("{coordinates} is not two coordinates"));
        };
        let place = Place { latitude, longitude, height: Height::AboveTakeoff(of(mark, height_name)?) };
        flown.require(of(mark, "index")? == i as f64, || format!("waypoint {i} has another index"));
        flown.way.push(place);
        let actions = mark.descendants().filter(|inner| inner.tag_name().name() == "actionActuatorFunc");
        let photos = actions.filter(|action| action.text() == Some("takePhoto")).count();
        for _ in 0..photos {
            let heading = of(mark, "waypointHeadingAngle")?;
            flown.photos.push(Photo { place, heading, pitch: of(mark, "gimbalPitchRotateAngle")? });
        }
    }
    Ok(flown)
}
