"""The notebook of the examples, and the package's types on it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="skipped: nbformat is not installed")
NOTEBOOK = Path(__file__).parents[2] / "examples" / "python" / "mesh_to_splats.ipynb"


def test_the_notebook_runs_from_top_to_bottom(tmp_path: Path) -> None:
    """If this failed, the first thing that a newcomer tries in Python would end with an error, or show nothing."""
    nbclient = pytest.importorskip("nbclient", reason="skipped: nbclient is not installed")
    pytest.importorskip("trimesh", reason="skipped: trimesh is not installed")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output["data"] for cell in notebook.cells for output in cell.get("outputs", []) if "data" in output]
    reports = [data["text/html"] for data in shown if "text/html" in data]
    assert len(reports) == 1 and reports[0].startswith("<iframe srcdoc=")
    assert sum("image/png" in data for data in shown) == 1


def test_the_notebook_has_the_types_that_the_package_says(tmp_path: Path) -> None:
    """If this failed, editors and checkers would call right programs wrong."""
    pytest.importorskip("mypy", reason="skipped: mypy is not installed")
    cells = [cell.source for cell in nbformat.read(NOTEBOOK, as_version=4).cells if cell.cell_type == "code"]
    (tmp_path / "notebook.py").write_text("\n\n".join(cells), encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--ignore-missing-imports", "--check-untyped-defs", "--config-file=", "notebook.py"]
    checked = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    (tmp_path / "wrong.py").write_text('import camsplat\ncamsplat.plan("a.ply", veiws=5)\ncamsplat.plan("a.ply", seed="x")\n')
    refused = subprocess.run([*command[:-1], "wrong.py"], cwd=tmp_path, capture_output=True, text=True)
    assert "veiws" in refused.stdout and "seed" in refused.stdout, refused.stdout
