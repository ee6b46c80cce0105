"""Sessions: where the next photos are to be, for programs that take them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import camsplat
from camsplat._cameras import Floats

Ball = tuple[Floats, np.ndarray]


def looking(positions: Floats) -> Floats:
    """Poses that look at the origin, with z up."""
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    for pose, position in zip(poses, positions):
        forward = -position / np.linalg.norm(position)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
        pose[:3, 3] = position
    return poses


def front(count: int) -> Floats:
    """Places before the ball, on an arc on the side of negative y."""
    angle = np.linspace(-2.2, -0.9, count)
    return np.stack([3 * np.cos(angle), 3 * np.sin(angle), np.full(count, 0.5)], axis=1)


def test_a_session_leads_around_what_it_has_not_seen(ball: Ball, tmp_path: Path) -> None:
    """If this failed, a robot would take its photos where it has been, or take no notice of those that it has taken."""
    session = camsplat.Session(*ball, size=(320, 240), fov=60, seed=2)
    with pytest.raises(camsplat.Error, match="add_photos"):
        session.next()
    session.add_photos(looking(front(4)))
    places = session.next(4)
    assert len(places) == 4 and np.array_equal(places.sizes[0], [320, 240])
    assert np.allclose(places.K, session.cameras.K[0])
    # Rotations, and the nearest to the last photo first.
    assert np.allclose(places.poses[:, :3, :3] @ places.poses[:, :3, :3].transpose(0, 2, 1), np.eye(3), atol=1e-6)
    away = np.linalg.norm(places.positions - front(4)[-1], axis=1)
    assert (np.diff(away) >= 0).all() and (places.positions[:, 1] > 0).sum() >= 2
    expected, sd, uncovered = session.expected, session.sd, session.uncovered
    assert expected > 1 and 0 < sd < expected and len(uncovered) > 100 and uncovered[:, 1].mean() > 0.2
    session.add_photos(places)
    assert len(session.cameras) == 8 and len(session.uncovered) < 0.7 * len(uncovered)
    assert session.expected < expected
    # The same of files: what the command is given.
    (tmp_path / "folder").mkdir()
    plan = camsplat.plan(*ball, 3, iterations=5, held_out=50)
    session.add_photos(plan.save(tmp_path / "folder", force=True) / "transforms.json")
    assert len(session.cameras) == 11 and repr(session) == "<camsplat.Session: 11 photos>"


def test_sessions_speak_python_and_refuse_what_they_have_not(ball: Ball) -> None:
    """If this failed, a wrong call would be explained in options of the command line, or be ignored."""
    session = camsplat.Session(*ball)
    session.add_photos(np.zeros((0, 4, 4)))
    assert len(session.cameras) == 0
    session.add_photos(looking(front(3)))
    with pytest.raises(camsplat.Error, match="views"):
        session.next(0)
    with pytest.raises(TypeError, match="unexpected keyword argument 'iterations'"):
        camsplat.Session(*ball, iterations=3)  # type: ignore[call-arg]
