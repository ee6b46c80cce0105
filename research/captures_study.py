#!/usr/bin/env python3
"""Plans for captures with a known world: photos of rooms posed by COLMAP, places proved free, and what more photos gain.

usage: captures_study.py make ROOMS OUT     cameras of seven captures (OUT/NAME.json) in the rooms of ROOMS (.glb)
       captures_study.py pose OUT           COLMAP on OUT/photos/NAME/images, into OUT/NAME; its similarity to the world
       captures_study.py truth ROOMS OUT PLAN...   of plans for captures (OUT/NAME beside the folders PLAN-NAME), who stands in the open
       captures_study.py hall OUT COUNT     a capture of so many photos of a hall, 50 points each, without tracks: for times of known space
       captures_study.py object OUT NAME PHOTOS RENDERED   of test views (folders of the pictures), PSNR within a disc around the object
       captures_study.py thin CAPTURE OUT   the capture without every eighth photo (OUT/full), those (OUT/test), and parts: a third left
                                            out at random (r1, r2), on one side (s1, s2), two thirds (t1), five sixths (x1)
       captures_study.py choose ROOMS OUT   10, 20 and 40 more cameras by plan, evenly, at random, with three seeds: views-NAME.json,
                                            sets.json, and the points in the room's frame, points-NAME.ply

Between make and pose: camsplat capture ROOM.glb OUT/NAME.json --env ROOM.env.hdr --exposure E --out OUT/photos/NAME, E -0.67 for the
classroom and the living room, -1 for the dining room (one metered on the windows leaves the tables almost black). After choose, the same
of views-NAME.json with --spp 32 --light baked, and a training of 4,000 iterations and 200,000 splats (--sh 2) from those points on the old
photos with those of each set, tested on the set `test`. After thin: camsplat score OUT/full OUT/PART, and such a training on each part,
tested on OUT/test. Needs numpy, trimesh, embreex, pycolmap, and camsplat on the path. docs/results/captures.md has what came out.
"""
import json
import os
import shutil
import subprocess
import sys

import numpy as np

# Units of a room to a metre.
METRE = {"living-room": 1.0, "dining-room": 3.0, "classroom": 1.0}
# Name: room; what is looked at, radii, heights, photos and angles of a ring, or the box of a walk and what height it looks at.
RINGS = {
    "lr-table": ("living-room", (2.6, 0.6, -1.95), (0.8, 1.5), (0.9, 1.7), 40, (0, 2)),
    "lr-sofa": ("living-room", (1.9, 0.55, -3.3), (1.0, 2.0), (0.9, 1.7), 36, (0.12, 0.88)),
    "dr-table": ("dining-room", (-0.4, 1.2, -2.2), (3.5, 6.0), (1.8, 4.5), 36, (0.08, 0.92)),
    "cl-desks": ("classroom", (-0.2, 0.9, -0.6), (1.2, 2.0), (1.35, 1.85), 56, (-0.05, 1.05)),
    "cl-corner": ("classroom", (-2.3, 1.36, -4.7), (1.2, 2.5), (1.3, 1.85), 36, (0.03, 0.5)),
}
WALKS = {
    "lr-walk": ("living-room", (0.6, 1.35, -3.0), (4.5, 1.75, -0.7), 56, 0.9),
    "cl-walk": ("classroom", (-2.6, 1.3, -4.0), (2.5, 1.9, 3.0), 72, 1.1),
}
# Radius of what is looked at.
OBJECT = {"lr-table": 0.55, "lr-sofa": 0.9, "dr-table": 2.5, "cl-desks": 0.8, "cl-corner": 0.8}
ROOM = {name: of[0] for name, of in {**RINGS, **WALKS}.items()}
SIZE, FOV = (800, 600), 65.0
COUNTS, SEEDS, TESTS = (10, 20, 40), (1, 2, 3), 48


class World:
    """A room's triangles, to cast rays at."""

    def __init__(self, rooms, room):
        import trimesh
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        self.rays = RayMeshIntersector(trimesh.load(os.path.join(rooms, room + ".glb"), force="mesh", process=False))

    def first(self, origins, directions):
        """Distance to the first hit of each ray."""
        places, rays, _ = self.rays.intersects_location(origins, directions, multiple_hits=False)
        away = np.full(len(origins), np.inf)
        away[rays] = np.linalg.norm(places - origins[rays], axis=1)
        return away

    def clearance(self, place, rng):
        directions = rng.normal(size=(200, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self.first(np.repeat(place[None], 200, 0), directions).min()

    def sees(self, origins, place):
        way = place - origins
        length = np.linalg.norm(way, axis=1)
        return self.first(origins, way / length[:, None]) > length - 1e-3


def looking(place, at):
    """Camera-to-world matrix, OpenGL axes, +Y up."""
    forward = (at - place) / np.linalg.norm(at - place)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(right, forward), -forward, place
    return matrix


def write(path, named, size=SIZE):
    focal = size[0] / 2 / np.tan(np.radians(FOV / 2))
    frames = [{"file_path": f"images/{name}.png", "transform_matrix": matrix.tolist()} for name, matrix in named]
    lens = {"fl_x": focal, "fl_y": focal, "cx": size[0] / 2, "cy": size[1] / 2, "w": size[0], "h": size[1]}
    with open(path, "w") as file:
        json.dump({**lens, "frames": frames}, file)


def make(rooms, out):
    os.makedirs(out, exist_ok=True)
    rng = np.random.default_rng(7)
    worlds = {room: World(rooms, room) for room in METRE}
    for name in ROOM:
        world, metre, poses = worlds[ROOM[name]], METRE[ROOM[name]], []
        while name in RINGS and len(poses) < RINGS[name][4]:
            _, at, radii, heights, count, angles = RINGS[name]
            turn = np.pi * rng.uniform(*angles)
            radius = rng.uniform(*radii)
            place = np.array([at[0] + radius * np.cos(turn), rng.uniform(*heights), at[2] + radius * np.sin(turn)])
            near = np.array(at) + 0.25 * (place - at) / np.linalg.norm(place - at)
            if world.sees(place[None], near)[0] and world.clearance(place, rng) > 0.2 * metre:
                poses.append(looking(place, np.array(at) + 0.12 * radius * rng.normal(size=3)))
        while name in WALKS and len(poses) < WALKS[name][3]:
            _, low, high, count, height = WALKS[name]
            low, high = np.array(low), np.array(high)
            middle, half = (low + high) / 2, (high - low) / 2 * rng.uniform(0.8, 1.0)
            turn = 2 * np.pi * (len(poses) + 0.5 * rng.random()) / count
            place = middle + half * [np.cos(turn), rng.uniform(-1, 1), np.sin(turn)]
            across = 2 * middle - place
            across[1] = height + 0.15 * rng.normal()
            if world.clearance(place, rng) > 0.2 * metre:
                poses.append(looking(place, across + metre * 0.2 * rng.normal(size=3) * [1, 0, 1]))
        write(os.path.join(out, name + ".json"), [(f"{i:03d}", pose) for i, pose in enumerate(poses)])


def umeyama(a, b):
    """Scale, rotation and translation that bring a to b by least squares, without pairs that are far off."""
    keep = np.ones(len(a), bool)
    for _ in range(10):
        ma, mb = a[keep].mean(0), b[keep].mean(0)
        u, s, vt = np.linalg.svd((b[keep] - mb).T @ (a[keep] - ma) / keep.sum())
        sign = np.array([1, 1, np.sign(np.linalg.det(u @ vt))])
        rotation = (u * sign) @ vt
        scale = (s * sign).sum() / ((a[keep] - ma) ** 2).sum(1).mean()
        moved = scale * (a - ma) @ rotation.T + mb
        off = np.linalg.norm(moved - b, axis=1)
        keep = off < max(5 * np.median(off), 1e-3)
    return scale, rotation, mb - scale * rotation @ ma


def pose(out):
    import pycolmap

    for name in ROOM:
        folder = os.path.join(out, name)
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(os.path.join(out, "photos", name, "images"), folder + "/images")
        os.makedirs(folder + "/sparse")
        database = folder + "/database.db"
        pycolmap.extract_features(database, folder + "/images", camera_mode=pycolmap.CameraMode.SINGLE)
        pycolmap.match_exhaustive(database)
        models = pycolmap.incremental_mapping(database, folder + "/images", folder + "/all")
        best = max(models, key=lambda i: models[i].num_reg_images())
        os.rename(f"{folder}/all/{best}", folder + "/sparse/0")
        shutil.rmtree(folder + "/all")
        with open(os.path.join(out, name + ".json")) as file:
            truth = {os.path.basename(f["file_path"]): f["transform_matrix"] for f in json.load(file)["frames"]}
        posed = [image for image in models[best].images.values() if image.has_pose]
        centres = np.array([image.projection_center() for image in posed])
        scale, rotation, shift = umeyama(centres, np.array([truth[image.name] for image in posed])[:, :3, 3])
        with open(folder + "/world.json", "w") as file:
            json.dump({"scale": scale, "rotation": rotation.tolist(), "shift": shift.tolist()}, file)
        print(name, len(posed), "photos posed,", models[best].num_points3D(), "points")


def planned(out, name, plan):
    """World poses of planned and of kept cameras of a plan."""
    with open(os.path.join(out, name, "world.json")) as file:
        world = json.load(file)
    rotation = np.array(world["rotation"])
    with open(os.path.join(plan, "plan.json")) as file:
        record = json.load(file)
    poses = []
    for camera in record["cameras"]:
        x, y, z, w = camera["pose"]["rotation"]
        own = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ])
        matrix = np.eye(4)
        matrix[:3, :3] = rotation @ own @ np.diag([1, -1, -1])
        matrix[:3, 3] = world["scale"] * rotation @ camera["pose"]["position"] + world["shift"]
        poses.append(matrix)
    count = len(poses) - record["kept"]
    return poses[:count], poses[count:]


def truth(rooms, out, plans):
    """A place is in the open if a photo, or a place that a photo sees, sees it through the true mesh."""
    total = {}
    for name in ROOM:
        world, rng = World(rooms, ROOM[name]), np.random.default_rng(3)
        for plan in plans:
            new, old = planned(out, name, f"{plan}-{name}")
            photos = np.array([pose[:3, 3] for pose in old])
            starts = photos[rng.integers(len(photos), size=300)]
            ways = rng.normal(size=(300, 3))
            ways /= np.linalg.norm(ways, axis=1, keepdims=True)
            reach = 0.9 * np.minimum(world.first(starts, ways), 3 * METRE[ROOM[name]]) * rng.random(300)
            open_places = np.concatenate([photos, starts + ways * reach[:, None]])
            free = sum(bool(world.sees(open_places, pose[:3, 3]).any()) for pose in new)
            before = total.get(plan, (0, 0))
            total[plan] = (before[0] + free, before[1] + len(new))
            print(name, plan, f"{free} of {len(new)} in the open")
    print({plan: f"{100 * free / count:.1f}%" for plan, (free, count) in total.items()})


def spread(candidates, photos):
    """Candidates one by one, each farthest from the photos and from those before it."""
    places = np.array([pose[:3, 3] for pose in candidates])
    away = np.linalg.norm(places[:, None] - photos[None], axis=2).min(1)
    chosen = []
    for _ in range(COUNTS[-1]):
        farthest = int(away.argmax())
        chosen.append(candidates[farthest])
        away = np.minimum(away, np.linalg.norm(places - places[farthest], axis=1))
    return chosen


def viewers(world, metre, old):
    """Viewers that no choice saw: up to a metre from a photo, looking about as one of the five nearest does."""
    rng, photos, poses = np.random.default_rng(23), np.array([pose[:3, 3] for pose in old]), []
    while len(poses) < TESTS:
        start, way = photos[rng.integers(len(photos))], rng.normal(size=3)
        place = start + way / np.linalg.norm(way) * rng.random() * metre
        if world.sees(start[None], place)[0] and world.clearance(place, rng) > 0.15 * metre:
            near = np.argsort(np.linalg.norm(photos - place, axis=1))[rng.integers(5)]
            poses.append(looking(place, place - old[near][:3, 2] + 0.2 * rng.normal(size=3)))
    return poses


def write_points(out, name):
    """The capture's points in the room's frame, with their colours."""
    import pycolmap

    with open(os.path.join(out, name, "world.json")) as file:
        world = json.load(file)
    rotation, points = np.array(world["rotation"]), pycolmap.Reconstruction(os.path.join(out, name, "sparse", "0")).points3D
    with open(os.path.join(out, f"points-{name}.ply"), "w") as file:
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        colours = "".join(f"property uchar {colour}\n" for colour in ("red", "green", "blue"))
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n{axes}{colours}end_header\n")
        for point in points.values():
            place = world["scale"] * rotation @ point.xyz + world["shift"]
            file.write("{:.5f} {:.5f} {:.5f} {} {} {}\n".format(*place, *point.color))


def choose(rooms, out):
    sets = {}
    for name in ROOM:
        def plan(arguments, to, name=name):
            folder = os.path.join(out, f"{to}-{name}")
            capture = os.path.join(out, name)
            command = ["camsplat", "plan", capture, "--keep", capture, *arguments.split(), "--out", folder, "--force"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            return planned(out, name, folder)

        chosen = {}
        for seed in SEEDS:
            for count in COUNTS:
                chosen[f"plan{count}-{seed}"] = plan(f"--views {count} --seed {seed}", f"plan{count}-{seed}")[0]
            candidates, chosen["old"] = plan(f"--views 400 --method random --seed {seed}", f"random-{seed}")
            order = np.random.default_rng(10 + seed).permutation(len(candidates))
            chosen[f"random-{seed}"] = [candidates[i] for i in order[: COUNTS[-1]]]
            chosen[f"even-{seed}"] = spread(candidates, np.array([pose[:3, 3] for pose in chosen["old"]]))
        chosen["test"] = viewers(World(rooms, ROOM[name]), METRE[ROOM[name]], chosen["old"])
        write_points(out, name)
        sets[name] = {kind: [f"{name}-{kind}-{i:03d}" for i in range(len(poses))] for kind, poses in chosen.items()}
        named = [(f"{name}-{kind}-{i:03d}", pose) for kind, poses in chosen.items() for i, pose in enumerate(poses)]
        write(os.path.join(out, f"views-{name}.json"), named, (640, 480))
    with open(os.path.join(out, "sets.json"), "w") as file:
        json.dump(sets, file)


def of_object(out, name, photos, rendered):
    """Mean PSNR within the disc that a sphere around the object of a ring becomes, over the test views of which it is two hundredths."""
    from PIL import Image

    with open(os.path.join(out, f"views-{name}.json")) as file:
        views = json.load(file)
    with open(os.path.join(out, "sets.json")) as file:
        tests = set(json.load(file)[name]["test"])
    centre, radius, found = np.array([*RINGS[name][1], 1.0]), OBJECT[name], []
    for frame in views["frames"]:
        picture = os.path.basename(frame["file_path"])
        x, y, z, _ = np.linalg.inv(frame["transform_matrix"]) @ centre
        if os.path.splitext(picture)[0] not in tests or -z < radius:
            continue
        a, b = (np.asarray(Image.open(os.path.join(of, picture)).convert("RGB"), float) for of in (photos, rendered))
        rows, columns = np.mgrid[: a.shape[0], : a.shape[1]]
        place = np.array([views["cx"] + views["fl_x"] * x / -z, views["cy"] - views["fl_y"] * y / -z])
        disc = np.hypot(columns - place[0], rows - place[1]) < views["fl_x"] * radius / -z
        if disc.mean() >= 0.02:
            found.append(10 * np.log10(255**2 / max(((a - b)[disc] ** 2).mean(), 1e-9)))
    print(f"{np.mean(found):.2f} dB, {len(found)} views")


def hall(out, count):
    """A hall of 12 x 8 x 3 with +Z up, walked through; points on its floor and walls."""
    os.makedirs(out, exist_ok=True)
    rng, size = np.random.default_rng(1), np.array([12.0, 8.0, 3.0])
    points = size * rng.random((max(4000, min(100_000, 50 * count)), 3))
    sides = rng.integers(5, size=len(points))
    for side, (axis, value) in enumerate([(2, 0.0), (1, 0.0), (1, 8.0), (0, 0.0), (0, 12.0)]):
        points[sides == side, axis] = value
    frames = []
    for i in range(count):
        place = [1, 1, 1.2] + rng.random(3) * [10, 6, 0.5]
        forward = np.array([12, 8, 2.4]) - 2 * place
        forward = np.array([*forward[:2], 1.2 - place[2]]) / np.linalg.norm([*forward[:2], 1.2 - place[2]])
        right = np.cross(forward, [0, 0, 1]) / np.linalg.norm(np.cross(forward, [0, 0, 1]))
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(right, forward), -forward, place
        frames.append((f"{i:05d}", matrix))
    write(os.path.join(out, "transforms.json"), frames)
    with open(os.path.join(out, "transforms.json")) as file:
        capture = json.load(file)
    with open(os.path.join(out, "transforms.json"), "w") as file:
        json.dump({**capture, "ply_file_path": "points.ply"}, file)
    header = "".join(f"property float {axis}\n" for axis in "xyz")
    with open(os.path.join(out, "points.ply"), "w") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n{header}end_header\n")
        np.savetxt(file, points, "%.4f")


def thin(capture, out):
    import pycolmap

    model = os.path.join(capture, "sparse", "0")
    posed = [image for image in pycolmap.Reconstruction(model).images.values() if image.has_pose]
    centre = {image.name: np.array(image.projection_center()) for image in posed}
    names = sorted(centre)
    full = [name for index, name in enumerate(names) if index % 8 != 3]
    rng = np.random.default_rng(41)
    parts = {"full": full, "test": names[3::8]}
    for part, share in (("r1", 2 / 3), ("r2", 2 / 3), ("t1", 1 / 3), ("x1", 1 / 6)):
        parts[part] = rng.choice(full, round(len(full) * share), replace=False)
    for part in ("s1", "s2"):
        side = centre[full[rng.integers(len(full))]]
        parts[part] = sorted(full, key=lambda name, side=side: np.linalg.norm(centre[name] - side))[len(full) // 3 :]
    for part, kept in parts.items():
        folder, kept = os.path.join(out, part), set(kept)
        os.makedirs(folder + "/sparse/0")
        whole = pycolmap.Reconstruction(model)
        for image in list(whole.images.values()):
            if image.has_pose and image.name not in kept:
                whole.deregister_frame(image.frame_id)
        whole.write_binary(folder + "/sparse/0")
        os.symlink(os.path.abspath(os.path.join(capture, "images")), folder + "/images")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["make", rooms, out]:
            make(rooms, out)
        case ["pose", out]:
            pose(out)
        case ["truth", rooms, out, *plans] if plans:
            truth(rooms, out, plans)
        case ["hall", out, count]:
            hall(out, int(count))
        case ["object", out, name, photos, rendered]:
            of_object(out, name, photos, rendered)
        case ["thin", capture, out]:
            thin(capture, out)
        case ["choose", rooms, out]:
            choose(rooms, out)
        case _:
            sys.exit(__doc__)
