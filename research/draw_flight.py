#!/usr/bin/env python3
"""Draws a flight on a map and from the side, from every file of it that `camsplat export` wrote, each read by its format alone.

usage: draw_flight.py PLAN_FOLDER FLIGHT_FOLDER OUT.png    (numpy, matplotlib)

The surface is the plan's, a mesh as .ply in ASCII with +z up, with the origin at LAT, LON, ALT of the plan's areas or of --geo 50,10,300.
"""
import csv
import json
import sys
import xml.etree.ElementTree as xml
import zipfile
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

LATITUDE, LONGITUDE, ALTITUDE = 50.0, 10.0, 300.0
# Metres in a degree at that latitude (WGS 84).
NORTH, EAST = 111_229.03, 71_695.75


def metres(latitude, longitude, altitude):
    return [(longitude - LONGITUDE) * EAST, (latitude - LATITUDE) * NORTH, altitude - ALTITUDE]


def inner(node, name):
    return next(child for child in node.iter() if child.tag.endswith("}" + name)).text


def litchi(file, home):
    rows = csv.DictReader(file.open())
    return [metres(float(r["latitude"]), float(r["longitude"]), home + float(r["altitude(m)"])) for r in rows]


def qgc(file, _):
    mission = json.loads(file.read_text())["mission"]
    home = mission["plannedHomePosition"][2]
    points = [item["params"][4:] for item in mission["items"] if item["command"] == 16]
    return [metres(x, y, home + z) for x, y, z in points]


def dji(file, home):
    root = xml.fromstring(zipfile.ZipFile(file).read("wpmz/waylines.wpml"))
    marks = [node for node in root.iter() if node.tag.endswith("}Placemark")]
    places = [(inner(mark, "coordinates").split(","), float(inner(mark, "executeHeight"))) for mark in marks]
    return [metres(float(at[1]), float(at[0]), home + height) for at, height in places]


def kml(file, _):
    lines = [node for node in xml.parse(file).getroot().iter() if node.tag.endswith("}LineString")]
    places = [at.split(",") for at in inner(lines[0], "coordinates").split()]
    return [metres(float(at[1]), float(at[0]), float(at[2])) for at in places]


def geojson(file, _):
    features = json.loads(file.read_text())["features"]
    line = next(f["geometry"]["coordinates"] for f in features if f["geometry"]["type"] == "LineString")
    return [metres(y, x, z) for x, y, z in line]


def mesh(path):
    lines = path.read_text().split("\n")
    counts = [int(line.split()[-1]) for line in lines if line.startswith("element")]
    body = lines[lines.index("end_header") + 1 :]
    vertices = np.array([[float(v) for v in line.split()[:3]] for line in body[: counts[0]]])
    faces = [[int(v) for v in line.split()[1:]] for line in body[counts[0] : counts[0] + counts[1]]]
    return [vertices[face] for face in faces]


def main():
    plan, flight, out = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    record = json.loads((plan / "plan.json").read_text())
    home = json.loads((flight / "mission.plan").read_text())["mission"]["plannedHomePosition"][2]
    readers = {"kmz": dji, "plan": qgc, "csv": litchi, "kml": kml, "geojson": geojson}
    ways = {name: np.array(read(flight / f"mission.{name}", home)) for name, read in readers.items()}
    first = next(iter(ways.values()))
    print({name: round(float(np.abs(way - first).max()), 4) for name, way in ways.items()}, "metres apart at most")
    cameras = np.array([camera["pose"]["position"] for camera in record["cameras"]])
    off = np.abs(first[:, None] - cameras[None]).max(axis=2).min(axis=0)
    print(f"cameras of the plan are {off.max():.4f} m from the way at most")

    figure, (top, side) = plt.subplots(1, 2, figsize=(13, 6))
    for axes, (i, j) in ((top, (0, 1)), (side, (0, 2))):
        for face in mesh(Path(record["surface"]["path"])):
            axes.fill(face[:, i], face[:, j], facecolor="#d8d4c8", edgecolor="#8a8472", linewidth=0.6, alpha=0.5)
        for volume in record.get("limits", {}).get("keep_out", []):
            for ring in volume.get("areas", []) if axes is top else []:
                corners = np.array([metres(y, x, 0)[:2] for x, y in ring + ring[:1]])
                axes.fill(*corners.T, facecolor="#c03030", alpha=0.15, edgecolor="#c03030")
        for (name, way), style in zip(ways.items(), ["-", "--", ":", "-.", (0, (1, 4))]):
            axes.plot(way[:, i], way[:, j], linestyle=style, linewidth=1.3, label=f".{name}")
        axes.plot(cameras[:, i], cameras[:, j], "k.", markersize=5)
        axes.set_aspect("equal")
        axes.set_xlabel("metres east")
    reach = 1.15 * np.abs(first).max()
    top.set(xlim=(-reach, reach), ylim=(-reach, reach), ylabel="metres north", title="from above")
    side.set(xlim=(-reach, reach), ylabel="metres above the origin", title="from the south")
    side.axhline(home - ALTITUDE, color="#308030", linewidth=0.8)
    top.legend(loc="lower left", fontsize=8)
    figure.tight_layout()
    figure.savefig(out, dpi=110)


main()
