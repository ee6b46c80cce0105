"""What places the photos of `camsplat watch`, without COLMAP: which pairs of photos it is given, and where it finds their files."""

from __future__ import annotations

import importlib.util
import os
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "src/app/watch/register.py"


class Database:
    """Photos around a thing: each shows the features of a part of it, noisily, and half of those of the next one."""

    def __init__(self, count: int) -> None:
        rng = np.random.default_rng(3)
        around = rng.random((20 * count, 128))
        self.images = [types.SimpleNamespace(name=f"{i:03}.png", image_id=i) for i in range(count)]
        self.features = [np.roll(around, -20 * i, axis=0)[:40] + 0.02 * rng.random((40, 128)) for i in range(count)]

    def __enter__(self) -> Database:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def read_all_images(self) -> list[Any]:
        return self.images

    def read_descriptors(self, image_id: int) -> Any:
        unit = self.features[image_id] / np.linalg.norm(self.features[image_id], axis=1)[:, None]
        return types.SimpleNamespace(data=(512 * unit).astype(np.uint8))


@pytest.fixture
def register(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The script with a COLMAP that notes what it is asked to match."""
    asked: list[Any] = []

    def match_image_pairs(database: str, pairing_options: Any) -> None:
        text = Path(pairing_options.match_list_path).read_text()
        asked.append({tuple(line.split()) for line in text.splitlines()})

    colmap: Any = types.ModuleType("pycolmap")
    colmap.match_exhaustive = lambda database: asked.append("all")
    colmap.match_image_pairs = match_image_pairs
    colmap.ImportedPairingOptions = types.SimpleNamespace
    colmap.Database = types.SimpleNamespace(open=lambda path: path)
    monkeypatch.setitem(sys.modules, "pycolmap", colmap)
    spec = importlib.util.spec_from_file_location("register", SCRIPT)
    assert spec is not None and spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.asked = asked
    return module


def test_many_photos_are_matched_with_those_before_and_those_alike(register: Any, tmp_path: Path) -> None:
    """If this failed, the last photo of a round would not be joined to the first, or hundreds of photos would take hours to match."""
    database = Database(120)
    names = [image.name for image in database.images]
    register.match(database, str(tmp_path), names[:60])
    assert register.asked == ["all"]
    register.match(database, str(tmp_path), names)
    pairs = register.asked[-1]
    assert len(pairs) < 0.6 * 120 * 119 / 2
    # Neighbours in time, and the round closed by what photos show alone.
    assert {(names[i], names[i + 1]) for i in range(119)} <= pairs and (names[0], names[-1]) in pairs
    # What is kept says the same the next time, and is made anew where it is damaged.
    register.match(database, str(tmp_path), names)
    (tmp_path / "alike.npz").write_bytes(b"PK\x03\x04 damaged")
    register.match(database, str(tmp_path), names)
    assert register.asked[-2] == register.asked[-1] == pairs
    # A list of pairs cannot have names with spaces.
    register.match(database, str(tmp_path), [*names, "a b.png"])
    assert register.asked[-1] == "all"


def test_links_follow_the_photos(register: Any, tmp_path: Path) -> None:
    """If this failed, COLMAP would see photos that were deleted or moved, or a photo would be written over."""
    a, b, c = (tmp_path / name for name in ("a.png", "b.png", "c.png"))
    for file in (a, b, c):
        file.write_text(file.name)
    folder = tmp_path / "links"

    def seen() -> dict[str, str]:
        return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}

    register.link(str(folder), {"a.png": str(a), "clip.mp4/1.png": str(b)})
    assert seen() == {"a.png": "a.png", "clip.mp4/1.png": "b.png"}
    register.link(str(folder), {"a.png": str(c), "b.png": str(b)})
    assert seen() == {"a.png": "c.png", "b.png": "b.png"} and [f.read_text() for f in (a, b, c)] == ["a.png", "b.png", "c.png"]


def test_copies_do_where_links_are_not_allowed(register: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If this failed, all photos would be copied again for each new one, or one that was replaced would be kept."""

    def refused(*_: object) -> None:
        raise OSError

    monkeypatch.setattr(os, "symlink", refused)
    photo, folder = tmp_path / "a.png", tmp_path / "links"
    photo.write_text("one")
    register.link(str(folder), {"a.png": str(photo)})
    before = os.stat(folder / "a.png").st_ino
    register.link(str(folder), {"a.png": str(photo)})
    assert os.stat(folder / "a.png").st_ino == before
    photo.write_text("another")
    register.link(str(folder), {"a.png": str(photo)})
    assert (folder / "a.png").read_text() == "another" and photo.read_text() == "another"
