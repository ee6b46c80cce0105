"""Writes the models beside this file with pycolmap 4 (pip install pycolmap==4.2.1), and what it knows of them.

lenses: a camera of each model that is no panorama, in a rig of its own. rig: three cameras in one rig, four times.
truth.json: by image, its centre in the world, and the pixels of three points in the camera's axes.
"""

import json
from pathlib import Path

import numpy as np
import pycolmap
from pycolmap import Camera, Frame, Image, Rig, Rigid3d, Rotation3d, SensorType, data_t, sensor_t

HERE = Path(__file__).parent
POINTS = [[0.1, 0.2, 1.0], [-0.3, 0.25, 1.0], [0.4, -0.1, 1.0]]
# Focal lengths and principal points come before these.
DISTORTIONS = {
    "SIMPLE_PINHOLE": [],
    "PINHOLE": [],
    "SIMPLE_RADIAL": [0.1],
    "RADIAL": [0.1, 0.02],
    "OPENCV": [0.1, 0.02, 0.001, 0.002],
    "OPENCV_FISHEYE": [0.1, 0.02, 0.001, 0.002],
    "FULL_OPENCV": [0.1, 0.02, 0.001, 0.002, 0.03, 0.04, 0.05, 0.06],
    "FOV": [0.8],
    "SIMPLE_RADIAL_FISHEYE": [0.1],
    "RADIAL_FISHEYE": [0.1, 0.02],
    "THIN_PRISM_FISHEYE": [0.1, 0.02, 0.001, 0.002, 0.03, 0.04, 0.005, 0.006],
    "RAD_TAN_THIN_PRISM_FISHEYE": [0.1, 0.02, 0.03, 0.04, 0.05, 0.06, 0.001, 0.002, 0.005, 0.006, 0.007, 0.008],
    "SIMPLE_DIVISION": [-0.2],
    "DIVISION": [-0.2],
    "SIMPLE_FISHEYE": [],
    "FISHEYE": [],
    "EUCM": [0.6, 1.1],
}
ONE_FOCAL = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_DIVISION", "SIMPLE_FISHEYE")
random = np.random.default_rng(1)


def motion(size):
    """A rigid motion at random."""
    rotation = random.normal(size=4)
    return Rigid3d(Rotation3d(rotation / np.linalg.norm(rotation)), size * random.normal(size=3))


def sensor(camera):
    """The sensor that a camera is."""
    return sensor_t(type=SensorType.CAMERA, id=camera.camera_id)


def camera(number, model):
    """A camera of 64 x 48 pixels."""
    focal = [60] if model in ONE_FOCAL else [60, 61]
    return Camera(model=model, width=64, height=48, params=[*focal, 32, 24, *DISTORTIONS[model]], camera_id=number)


def write(name, rigs):
    """Writes a model in which each of `rigs`, which are lists of cameras, is there at the times that it says."""
    model, truth, number = pycolmap.Reconstruction(), {}, 1
    for rig_id, (cameras, times) in enumerate(rigs, 1):
        rig = Rig(rig_id=rig_id)
        for i, one in enumerate(cameras):
            model.add_camera(one)
            if i == 0:
                rig.add_ref_sensor(sensor(one))
            else:
                rig.add_sensor(sensor(one), motion(0.2))
        model.add_rig(rig)
        for _ in range(times):
            frame = Frame(frame_id=number, rig_id=rig_id)
            own = list(enumerate(cameras, number))
            for i, one in own:
                frame.add_data_id(data_t(sensor_id=sensor(one), id=i))
            frame.rig_from_world = motion(3)
            model.add_frame(frame)
            for i, one in own:
                image = Image(image_id=i, camera_id=one.camera_id, name=f"{i:03}.jpg")
                image.frame_id = frame.frame_id
                model.add_image(image)
            number += len(cameras)
    for image in model.images.values():
        pixels = [model.cameras[image.camera_id].img_from_cam(np.array(point)).tolist() for point in POINTS]
        truth[image.name] = {"centre": image.projection_center().tolist(), "pixels": pixels}
    folder = HERE / name
    folder.mkdir(exist_ok=True)
    model.write_binary(folder)
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


write("lenses", [([camera(i, model)], 1) for i, model in enumerate(DISTORTIONS, 1)])
write("rig", [([camera(1, "PINHOLE"), camera(2, "OPENCV"), camera(3, "FISHEYE")], 4)])
