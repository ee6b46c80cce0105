#!/usr/bin/env python3
"""A house with two trees on a lawn, in metres, +z up, as an ASCII PLY on standard output.

usage: house.py [HALF_SIDE_OF_THE_LAWN [CELLS]] > house.ply    (default 45 and 24)
"""
import math
import sys

half, cells = float((sys.argv[1:2] or ["45"])[0]), int((sys.argv[2:3] or ["24"])[0])
vertices, faces = [], []


def face(*corners):
    faces.append([len(vertices) + i for i in range(len(corners))])
    vertices.extend(corners)


def ground(x, y):
    return 1.5 + 0.4 * math.sin(0.13 * x) + 0.3 * math.cos(0.17 * y)


for i in range(cells):
    for j in range(cells):
        (x0, x1), (y0, y1) = ([-half + 2 * half * k / cells for k in (n, n + 1)] for n in (i, j))
        face(*[(x, y, ground(x, y)) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))])

# Walls of 12 x 8 m, and a gabled roof.
X, Y, BOTTOM, EAVES, RIDGE = 6, 4, 1.0, 7.0, 10.0
for (x0, y0), (x1, y1) in (((-X, -Y), (X, -Y)), ((X, -Y), (X, Y)), ((X, Y), (-X, Y)), ((-X, Y), (-X, -Y))):
    face((x0, y0, BOTTOM), (x1, y1, BOTTOM), (x1, y1, EAVES), (x0, y0, EAVES))
for side in (-1, 1):
    corners = [(-X - 0.5, side * (Y + 0.5), EAVES - 0.3), (X + 0.5, side * (Y + 0.5), EAVES - 0.3), (X + 0.5, 0, RIDGE), (-X - 0.5, 0, RIDGE)]
    face(*corners[::-side])
    gable = [(side * X, -Y, EAVES), (side * X, Y, EAVES), (side * X, 0, RIDGE)]
    face(*gable[::side])

for x, y, height in ((-13, 9, 9), (11, -12, 7)):
    low = ground(x, y)
    for k in range(6):
        a, b = math.tau * k / 6, math.tau * (k + 1) / 6

        def around(angle, radius, z, x=x, y=y):
            return (x + radius * math.cos(angle), y + radius * math.sin(angle), z)

        face(around(a, 2, low + 1), around(b, 2, low + 1), (x, y, low + height))
        face(around(b, 2, low + 1), around(a, 2, low + 1), around(a, 0.3, low), around(b, 0.3, low))

print("ply\nformat ascii 1.0")
print(f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z")
print(f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header")
for vertex in vertices:
    print(*(f"{v:.4f}" for v in vertex))
for corners in faces:
    print(len(corners), *corners)
