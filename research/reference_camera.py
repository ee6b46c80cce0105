#!/usr/bin/env python3
"""The camera of a room's reference picture as a transforms.json that `camsplat capture` reads.

research/reference_camera.py ROOM.json --width 320 > camera.json, where ROOM.json has `camera` with position, look_at, up,
horizontal_fov_deg and resolution, in the axes of the room's glTF file.
"""

import argparse
import json
import math


def subtract(a, b):
    return [x - y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    length = math.sqrt(sum(x * x for x in a))
    return [x / length for x in a]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("room")
    parser.add_argument("--width", type=int, help="of the picture in pixels [default: the reference's]")
    arguments = parser.parse_args()
    with open(arguments.room, encoding="utf-8") as file:
        camera = json.load(file)["camera"]
    wide, high = camera["resolution"]
    width = arguments.width or wide
    height = round(width * high / wide)
    focal = 0.5 * width / math.tan(0.5 * math.radians(camera["horizontal_fov_deg"]))
    # Axes of the camera as NeRF's files have them: right, up, backward.
    backward = unit(subtract(camera["position"], camera["look_at"]))
    right = unit(cross(camera["up"], backward))
    up = cross(backward, right)
    columns = [right, up, backward, camera["position"]]
    matrix = [[column[row] for column in columns] for row in range(3)] + [[0, 0, 0, 1]]
    frame = {"file_path": "view.png", "transform_matrix": matrix}
    lens = {"w": width, "h": height, "fl_x": focal, "fl_y": focal, "cx": 0.5 * width, "cy": 0.5 * height}
    print(json.dumps({**lens, "frames": [frame]}))


if __name__ == "__main__":
    main()
