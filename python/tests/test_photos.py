"""Photos: selection, training, rendering, evaluation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import camsplat


def test_what_is_trained_looks_like_the_photos(capture: Path, splats: Path, tmp_path: Path) -> None:
    """If this failed, the way from a plan to splats would not work from Python."""
    calls: list[tuple[str, int, int]] = []
    training = camsplat.train(
        capture,
        tmp_path / "model",
        iterations=150,
        max_splats=2000,
        sh=0,
        background="white",
        progress=lambda *call: calls.append(call),
    )
    assert training.psnr is not None and training.ssim is not None
    assert calls[-1][1:] == (150, 150) and any(call[0].startswith("training") for call in calls)
    plan = camsplat.Plan(capture)
    trained = camsplat.render(training, plan, background="white")
    truth = camsplat.render(splats, plan.cameras, background="white")
    assert len(trained) == 16 and trained[0].image.dtype == np.float32
    # A picture of one colour, the best there is for each, has four times the error at least.
    errors = [float(np.mean((a.image - b.image) ** 2)) for a, b in zip(trained, truth)]
    flat = [float(b.image.var(axis=(0, 1)).mean()) for b in truth]
    assert np.mean(errors) < np.mean(flat) / 4, (np.mean(errors), np.mean(flat))
    assert abs(training.psnr + 10 * np.log10(np.mean(errors))) < 3
    with pytest.raises(camsplat.Error, match="not empty"):
        camsplat.train(capture, tmp_path / "model", iterations=150)
    assert training.cameras is None
    # Without a folder, the model lasts as long as what is returned.
    short = camsplat.train(capture, iterations=10, max_splats=2000, sh=0, refine_poses=True)
    assert short.cameras is not None
    given = dict(zip(plan.cameras.names, plan.cameras.poses))
    for name, pose in zip(short.cameras.names, short.cameras.poses):
        moved = pose - given[name.removesuffix(".png")]
        assert 0 < np.abs(moved).max() < 0.2, (name, moved)
    [one] = camsplat.render(short, plan.cameras[:1])
    assert one.image.std() > 0 and short.model.is_file()
    folder = short.folder
    del short
    assert not folder.exists()


def test_selected_photos_are_a_capture(capture: Path, tmp_path: Path) -> None:
    """If this failed, what `select` returns would not be what it has written."""
    selection = camsplat.select(capture, 6, out=tmp_path / "best")
    assert len(selection.names) == 6 and sorted(selection.cameras.names) == sorted(selection.names)
    everything = camsplat.read_cameras(capture)
    index = [everything.names.index(name.removesuffix(".png")) for name in selection.cameras.names]
    assert np.allclose(everything.poses[index], selection.cameras.poses, atol=1e-9)
    worth = {photo["name"]: photo["contribution_db"] for photo in selection.record["chosen"]}
    assert [worth[name] for name in selection.names] == sorted(worth.values(), reverse=True)
    assert camsplat.select(capture, 6).names == selection.names
    with pytest.raises(camsplat.Error, match="count"):
        camsplat.select(capture, 17)


def test_an_evaluation_is_rows(tmp_path: Path) -> None:
    """If this failed, the table of an evaluation could not be worked with, or a second call would begin anew."""
    request = {"situation": "two-rooms", "quick": True, "methods": ["random"], "budgets": 4, "seeds": 1}
    request |= {"iterations": 10, "size": 32, "spp": 1, "input_spp": 1, "tests": 2, "inputs": 5}
    lines: list[tuple[str, int, int]] = []
    evaluation = camsplat.evaluate(
        [],
        tmp_path,
        progress=lambda *call: lines.append(call),
        **request,  # type: ignore[arg-type]
    )
    [psnr] = [row for row in evaluation.rows if row["metric"] == "PSNR"]
    assert (psnr["method"], psnr["views"], psnr["seeds"]) == ("random", 4, 1) and isinstance(psnr["mean"], float)
    assert lines[-1] == ("evaluating", 1, 1)
    written = (tmp_path / "results.json").stat().st_mtime_ns, evaluation.rows
    again = camsplat.evaluate([], tmp_path, **request)  # type: ignore[arg-type]
    assert again.rows == written[1]
    # A frame in a notebook has no folder beside it.
    assert '<img src="' in (tmp_path / "report.html").read_text()
    assert "data:image/png;base64," in evaluation._frame(400) and "&lt;img src=&quot;two-rooms" not in evaluation._frame(400)


def test_what_cannot_be_rendered_is_refused(splats: Path, capture: Path, tmp_path: Path) -> None:
    """If this failed, a wrong file or colour would end the interpreter or make a wrong image."""
    for keywords, message in [
        ({"background": "pink"}, "background"),
        ({"background": (0, 2, 0)}, "background"),
        ({"background": 5}, "background"),
        ({"background": ["a", 0, 0]}, "background"),
        ({"background": "white", "alpha": True}, "alpha"),
        ({"near": -1.0}, "near is -1"),
    ]:
        with pytest.raises(camsplat.Error, match=message):
            camsplat.render(splats, capture, **keywords)  # type: ignore[arg-type]
    (tmp_path / "broken.ply").write_text("ply\n")
    with pytest.raises(camsplat.Error, match=r"broken\.ply"):
        camsplat.render(tmp_path / "broken.ply", capture)
