"""Fixtures that the tests make themselves: a surface, trained splats, photos of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import camsplat
from camsplat._cameras import Floats


@pytest.fixture(scope="session")
def ball() -> tuple[Floats, np.ndarray]:
    """Vertices and faces of an octahedron whose faces were divided in four three times, of radius 1."""
    vertices = [np.array(v, dtype=float) for v in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(3):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, middles: dict[tuple[int, int], int] = middles) -> int:
            key = (min(a, b), max(a, b))
            if key not in middles:
                between = vertices[a] + vertices[b]
                vertices.append(between / np.linalg.norm(between))
                middles[key] = len(vertices) - 1
            return middles[key]

        divided = []
        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            divided += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = divided
    return np.array(vertices), np.array(faces)


def write_splats(file: Path, centres: Floats, colours: Floats, scale: float, opacity: float = 0.99) -> None:
    """Writes round splats in the usual 3DGS layout; colours are sRGB from 0 to 1."""
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2"]
    names += ["rot_0", "rot_1", "rot_2", "rot_3"]
    table = np.zeros(len(centres), dtype=[(name, "<f4") for name in names])
    for axis, name in enumerate("xyz"):
        table[name] = centres[:, axis]
        table[f"f_dc_{axis}"] = (colours[:, axis] - 0.5) / 0.28209479177387814
        table[f"scale_{axis}"] = np.log(scale)
    table["opacity"] = np.log(opacity / (1 - opacity))
    table["rot_0"] = 1
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    file.write_bytes(header.encode() + table.tobytes())


@pytest.fixture(scope="session")
def splats(ball: tuple[Floats, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Splats on the ball, coloured by their place."""
    file = tmp_path_factory.mktemp("splats") / "ball.ply"
    vertices, _ = ball
    write_splats(file, vertices, 0.5 + 0.4 * vertices, scale=0.06)
    return file


@pytest.fixture(scope="session")
def capture(ball: tuple[Floats, np.ndarray], splats: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A planned capture of the splats: 16 photos of 48 x 48 pixels."""
    folder = tmp_path_factory.mktemp("capture") / "plan"
    plan = camsplat.plan(*ball, views=16, size=(48, 48), out=folder)
    camsplat.command("render", splats, folder, out=folder / "images", background="white")
    assert len(plan.cameras) == 16
    return folder
