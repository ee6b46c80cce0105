"""Exports for drones and maps, whose places and directions are compared with those that PROJ gives the cameras."""
import csv
import time
import zipfile

import fastkml
import geojson
import numpy as np
from fastkml import validator
from lxml import etree
from mavsdk import mavsdk
from mavsdk.plugins.mission_raw import MissionRaw
from pymavlink.dialects.v20 import common as mavlink
from pyproj import Transformer
from table import by, row

# Metres and degrees: heights are written in centimetres, pitches of gimbals in tenths of a degree, DJI's headings in whole degrees.
METRES, DEGREES, WHOLE_DEGREES = 0.02, 0.1, 0.6
NAMES = {"k": "http://www.opengis.net/kml/2.2", "w": "http://www.dji.com/wpmz/1.0.2"}


class Earth:
    """Where a scene is by PROJ: `utm:ZONE`, or LAT,LON,ALT,HEADING of its origin and of its +Y (-Z where Y is up)."""

    def __init__(self, place, up):
        self.to_map = np.eye(3)
        if place.startswith("utm:"):
            zone = f"+zone={place[4:-1]} {'+south' * (place[-1] in 'sS')}"
            self.map = Transformer.from_pipeline(f"+proj=pipeline +step +inv +proj=utm {zone} +ellps=WGS84")
            return
        latitude, longitude, altitude, heading = map(float, place.split(","))
        north = np.array([0, 0, -1.0] if np.argmax(np.abs(up)) == 1 else [0, 1.0, 0])
        sin, cos = np.sin(np.radians(heading)), np.cos(np.radians(heading))
        self.to_map = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]) @ np.array([np.cross(north, up), north, up])
        self.map = self.around(longitude, latitude, altitude, "+inv")

    @staticmethod
    def around(longitude, latitude, altitude, inverse=""):
        """From longitude, latitude and altitude to metres east, north and up of a place, or back."""
        steps = ["+proj=cart +ellps=WGS84", f"+proj=topocentric +ellps=WGS84 +lon_0={longitude} +lat_0={latitude} +h_0={altitude}"]
        return Transformer.from_pipeline("+proj=pipeline " + " ".join(f"+step {inverse} {step}" for step in (steps[::-1] if inverse else steps)))

    def place(self, point):
        return self.map.transform(*(self.to_map @ point))

    def off(self, view, longitude, latitude, altitude, heading, pitch):
        """Metres and degrees that a waypoint is off the camera."""
        around = self.around(*self.place(view.centre))
        forward = np.array(around.transform(*self.place(view.centre + view.rotation[:, 2])))
        h, p = np.radians([heading, pitch])
        direction = np.array([np.sin(h) * np.cos(p), np.cos(h) * np.cos(p), np.sin(p)])
        angle = np.arctan2(np.linalg.norm(np.cross(direction, forward)), direction @ forward)
        return np.linalg.norm(around.transform(longitude, latitude, altitude)), np.degrees(angle)


def read(folder, cameras, earth, takeoff):
    def check(file, reader, waypoints, degrees=DEGREES, remark=""):
        """Waypoints with a photo, in the cameras' order: longitude, latitude, altitude, heading, pitch."""
        offs = np.array([earth.off(view, *waypoint) for view, waypoint in zip(cameras.values(), waypoints, strict=True)])
        row(file, f"{reader}, {by('pyproj')}", "places", offs[:, 0].max(), "m", METRES, remark)
        row(file, f"{reader}, {by('pyproj')}", "directions", offs[:, 1].max(), "degrees", degrees, remark)

    archive = zipfile.ZipFile(folder / "mission.kmz")
    for inner, height in [("wpmz/template.kml", "height"), ("wpmz/waylines.wpml", "executeHeight")]:
        marks = etree.fromstring(archive.read(inner)).iterfind(".//k:Placemark[w:actionGroup]", NAMES)
        waypoints = [dji(mark, height, takeoff) for mark in marks]
        check(f"export/mission.kmz: {inner}", by("lxml"), waypoints, WHOLE_DEGREES, "DJI's headings are whole degrees")
    check("export/mission.plan", by("mavsdk"), qgroundcontrol(folder / "mission.plan", takeoff), remark="MAVLink's places are 1e-7 degrees")
    lines = [line for line in csv.DictReader(open(folder / "mission.csv")) if "1" in [line[f"actiontype{i}"] for i in range(1, 16)]]
    check("export/mission.csv", "csv of Python, Litchi's columns", [litchi(line, takeoff) for line in lines])
    valid = validator.validate(file_to_validate=folder / "mission.kml")
    row("export/mission.kml", f"schema 2.2 of the OGC in {by('fastkml')}", "errors", 0 if valid else 1, "", 0)
    marks = fastkml.KML.parse(folder / "mission.kml").features[0].features
    views = [mark.view for mark in marks if mark.view is not None]
    waypoints = [(view.longitude, view.latitude, view.altitude, view.heading, view.tilt - 90) for view in views]
    check("export/mission.kml", by("fastkml"), waypoints)
    # The package rounds what it reads to six digits, a decimetre, unless it is told otherwise.
    geojson.geometry.DEFAULT_PRECISION = 15
    collection = geojson.load(open(folder / "mission.geojson"))
    row("export/mission.geojson", by("geojson"), "errors", len(collection.errors() or []), "", 0)
    photos = {feature.properties["name"]: feature for feature in collection.features if feature.geometry.type == "Point"}
    check("export/mission.geojson", by("geojson"), [
        (*photos[name].geometry.coordinates, photos[name].properties["heading"], photos[name].properties["pitch"]) for name in cameras])


def dji(mark, height, takeoff):
    longitude, latitude = map(float, mark.findtext("k:Point/k:coordinates", namespaces=NAMES).split(","))
    value = {name: float(mark.findtext(f".//w:{name}", namespaces=NAMES)) for name in (height, "waypointHeadingAngle", "gimbalPitchRotateAngle")}
    return longitude, latitude, value[height] + takeoff, value["waypointHeadingAngle"], value["gimbalPitchRotateAngle"]


def litchi(line, takeoff):
    longitude, latitude, height, heading, pitch = (
        float(line[name]) for name in ("longitude", "latitude", "altitude(m)", "heading(deg)", "gimbalpitchangle"))
    return longitude, latitude, height + takeoff, heading, pitch


def qgroundcontrol(path, takeoff):
    """A .plan as MAVSDK imports it. It does so for a vehicle alone, so that it is given a heartbeat, which it cannot answer."""
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION))
    sdk.add_any_connection("raw://")
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 0, 0, mavlink.MAV_STATE_ACTIVE)
    while not sdk.get_systems():
        sdk.pass_received_raw_bytes(bytes(beat.pack(link)))
        time.sleep(0.1)
    waypoints, pitch, place = [], None, None
    for item in MissionRaw(sdk.get_systems()[0]).import_qgroundcontrol_mission(str(path)).mission_items:
        if item.command == mavlink.MAV_CMD_DO_MOUNT_CONTROL:
            pitch = item.param1
        elif item.command == mavlink.MAV_CMD_NAV_WAYPOINT and item.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT:
            place = (item.y / 1e7, item.x / 1e7, item.z + takeoff, item.param4)
        elif item.command == mavlink.MAV_CMD_IMAGE_START_CAPTURE:
            waypoints.append((*place, pitch))
    return waypoints
