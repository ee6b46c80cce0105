#!/usr/bin/env python3
"""A ROS 2 node for a robot that takes photos of a scene whose surface is known: where it should take the next ones.

    python3 next_views_node.py --ros-args -p surface:=room.glb -p preset:=room -p views:=3

It takes `camera_info` (sensor_msgs/CameraInfo: the lens of the photos) and `photo` (geometry_msgs/PoseStamped: the pose at which one has
been taken), and answers each photo with `next_views` (geometry_msgs/PoseArray, the nearest to that photo first) and `expected_gain`
(std_msgs/Float32: decibels that these are expected to gain). Poses are of the camera's optical frame (x right, y down, z forward, REP 103)
in the frame of the surface.

`Advisor` needs no ROS: it takes and gives messages by their fields. The node itself (`main`) needs rclpy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

import camsplat


class Advisor:
    """What the node knows: a surface, a lens, and the photos so far."""

    def __init__(self, surface: Any, faces: Any = None, *, views: int = 3, **options: Any) -> None:
        """Of a surface as `camsplat.Session` takes it; `options` are those of `camsplat next`."""
        self._scene, self._views, self._options = (surface, faces), views, options
        self._lens: dict[str, Any] = {}
        self._poses: list[npt.NDArray[np.float64]] = []

    def camera_info(self, message: Any) -> None:
        """The lens, without distortion; of photos that are taken from now on and before."""
        self._lens = {"K": np.asarray(message.k, dtype=float).reshape(3, 3), "size": (message.width, message.height)}

    def photo(self, message: Any) -> tuple[list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]], float]:
        """Takes note of a photo.

        Returns:
            Places (3,) and quaternions (4,) x, y, z, w of the next ones, the nearest first; and what they gain in decibels.

        Raises:
            camsplat.Error: as `camsplat.Session`.
            LookupError: where the lens is not known yet.
        """
        if not self._lens:
            raise LookupError("no camera_info has come yet: the lens of the photos is unknown")
        at, turn = message.pose.position, message.pose.orientation
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = matrix(turn.x, turn.y, turn.z, turn.w), (at.x, at.y, at.z)
        self._poses.append(pose)
        session = camsplat.Session(*self._scene, **self._lens, **self._options)
        session.add_photos(np.stack(self._poses))
        places = session.next(self._views)
        return [(pose[:3, 3], quaternion(pose[:3, :3])) for pose in places.poses], session.expected


def matrix(x: float, y: float, z: float, w: float) -> npt.NDArray[np.float64]:
    """(3, 3) of a quaternion of any length."""
    x, y, z, w = np.array([x, y, z, w]) / np.linalg.norm([x, y, z, w])
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(rotation: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(4,) x, y, z, w of a rotation (3, 3): the eigenvector of the largest eigenvalue (Bar-Itzhack 2000)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    symmetric = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    return np.linalg.eigh(symmetric / 3)[1][:, -1]


def main() -> None:
    import rclpy
    from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion
    from rclpy.node import Node
    from sensor_msgs.msg import CameraInfo
    from std_msgs.msg import Float32

    rclpy.init()
    node = Node("next_views")
    surface = node.declare_parameter("surface", "").value
    preset = node.declare_parameter("preset", "object").value
    views = node.declare_parameter("views", 3).value
    advisor = Advisor(surface, views=views, preset=preset)
    next_views = node.create_publisher(PoseArray, "next_views", 10)
    expected_gain = node.create_publisher(Float32, "expected_gain", 10)

    def photo(message: PoseStamped) -> None:
        try:
            places, gain = advisor.photo(message)
        except (camsplat.Error, LookupError) as error:
            node.get_logger().error(str(error))
            return
        poses = [
            Pose(position=Point(**dict(zip("xyz", map(float, at)))), orientation=Quaternion(**dict(zip("xyzw", map(float, turn)))))
            for at, turn in places
        ]
        next_views.publish(PoseArray(header=message.header, poses=poses))
        expected_gain.publish(Float32(data=gain))

    node.create_subscription(CameraInfo, "camera_info", advisor.camera_info, 10)
    node.create_subscription(PoseStamped, "photo", photo, 10)
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()


if __name__ == "__main__":
    main()
