"""The ROS 2 node of the examples, with messages as ROS 2 defines them; rclpy is not on PyPI, so what needs it is not run here."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_session import Ball, front, looking

stores = pytest.importorskip("rosbags.typesys")

NODE = Path(__file__).parents[2] / "examples/python/next_views_node.py"


def node() -> Any:
    spec = importlib.util.spec_from_file_location("next_views_node", NODE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_node_leads_a_robot_around(ball: Ball) -> None:
    """If this failed, a robot would be sent to poses in other axes, or its messages not be understood."""
    example, store = node(), stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    kinds = store.types

    def sent(kind: str, message: Any) -> Any:
        """As it arrives on the other side."""
        return store.deserialize_cdr(store.serialize_cdr(message, kind), kind)

    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](0, 0), "map")

    def stamped(pose: Any) -> Any:
        at = kinds["geometry_msgs/msg/Point"](*pose[:3, 3])
        turn = kinds["geometry_msgs/msg/Quaternion"](*example.quaternion(pose[:3, :3]))
        kind = "geometry_msgs/msg/PoseStamped"
        return sent(kind, kinds[kind](header, kinds["geometry_msgs/msg/Pose"](at, turn)))

    advisor = example.Advisor(*ball, views=4, seed=2)
    poses = looking(front(4))
    with pytest.raises(LookupError, match="camera_info"):
        advisor.photo(stamped(poses[0]))
    region = kinds["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.array([277.0, 0, 160, 0, 277, 120, 0, 0, 1])
    info = kinds["sensor_msgs/msg/CameraInfo"](header, 240, 320, "plumb_bob", np.zeros(5), k, np.eye(3).ravel(), np.zeros(12), 0, 0, region)
    advisor.camera_info(sent("sensor_msgs/msg/CameraInfo", info))
    gains = []
    for pose in poses:
        places, gain = advisor.photo(stamped(pose))
        gains.append(gain)
    assert len(places) == 4 and gains[-1] < gains[0] and gains[-1] > 1
    away = [np.linalg.norm(at - poses[-1][:3, 3]) for at, _ in places]
    assert away == sorted(away)
    for at, turn in places:
        # The camera looks along z of the optical frame: at the ball.
        forward = example.matrix(*turn)[:, 2]
        assert np.dot(forward, -at) / np.linalg.norm(at) > 0.8, (at, turn)
    # A rotation goes through its quaternion and back.
    for pose in poses:
        assert np.allclose(example.matrix(*example.quaternion(pose[:3, :3])), pose[:3, :3], atol=1e-9)
