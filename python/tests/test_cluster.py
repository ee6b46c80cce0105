"""Evaluations over a Ray cluster."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import camsplat

SCRIPT = Path(__file__).parents[2] / "examples" / "python" / "sweep_ray.py"
OPTIONS = {"situation": "two-rooms", "quick": True, "methods": "random,grid", "budgets": 4, "seeds": 2, "iterations": 50, "size": 32}
OPTIONS |= {"spp": 1, "input_spp": 1, "tests": 2, "inputs": 5, "max_splats": 500}


def measured(folder: Path) -> list[dict[str, str]]:
    """The table without times."""
    with open(folder / "table.csv", newline="") as file:
        return [row for row in csv.DictReader(file) if row["metric"] != "choice_seconds"]


def workers() -> list[int]:
    """The processes that Ray has started for shards."""
    found = []
    for process in Path("/proc").iterdir():
        try:
            if process.name.isdigit() and (process / "cmdline").read_bytes().startswith(b"ray::make_shard"):
                found.append(int(process.name))
        except OSError:  # it has ended
            continue
    return found


def test_a_cluster_that_loses_a_worker_equals_one_process(tmp_path: Path) -> None:
    """If this failed, a sweep would have other results than one machine, or a worker that dies would cost more than its own run."""
    pytest.importorskip("ray", reason="skipped: ray is not installed")
    camsplat.evaluate([], tmp_path / "alone", **OPTIONS)  # type: ignore[arg-type]
    command = [sys.executable, str(SCRIPT), "evaluation", "--shards", "2", "--cpu", "--out", "together", "--options", json.dumps(OPTIONS)]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as sweep:
        scene = tmp_path / "together" / "two-rooms"
        while sweep.poll() is None and not any(scene.glob("training-*")):
            with contextlib.suppress(subprocess.TimeoutExpired):
                sweep.wait(0.05)
        os.kill(workers()[0], signal.SIGKILL)
        output, _ = sweep.communicate(timeout=600)
    assert sweep.returncode == 0, output
    assert measured(tmp_path / "together") == measured(tmp_path / "alone") != []
