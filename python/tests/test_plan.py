"""Plans: the same as the command's, watched, stopped, refused, looked at."""

from __future__ import annotations

import inspect
import json
import logging
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import TypedDict, Union, get_type_hints

import numpy as np
import pytest

import camsplat
from camsplat._cameras import Floats

Ball = tuple[Floats, np.ndarray]


class Quick(TypedDict):
    """Options of plans whose quality does not matter."""

    iterations: int
    held_out: int


QUICK: Quick = {"iterations": 20, "held_out": 50}


def write_ply(file: Path, vertices: Floats, faces: np.ndarray) -> None:
    """A PLY in text, which the package itself does not write."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}", "property double x", "property double y"]
    lines += ["property double z", f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(repr(float(value)) for value in vertex) for vertex in vertices]
    lines += ["3 " + " ".join(str(int(corner)) for corner in face) for face in faces]
    file.write_text("\n".join(lines) + "\n")


def test_a_plan_of_arrays_is_that_of_the_command(ball: Ball, tmp_path: Path) -> None:
    """If this failed, a plan from Python would be another than the same request gives on the command line."""
    write_ply(tmp_path / "ball.ply", *ball)
    command = [sys.executable, "-m", "camsplat", "plan", "ball.ply", "--views", "9", "--seed", "3", "--floor", "-0.5"]
    command += ["--wall", "1.5,0,0,-1,0,0", "--wall", "0,1.5,0,0,-1,0", "--size", "640x480", "--fov", "60", "--out", "plan"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    of_command = camsplat.Plan(tmp_path / "plan")
    walls = [(1.5, 0, 0, -1, 0, 0), (0, 1.5, 0, 0, -1, 0)]
    plan = camsplat.plan(*ball, 9, seed=3, floor=-0.5, wall=walls, size=(640, 480), fov=60)
    assert np.array_equal(plan.poses, of_command.poses) and np.array_equal(plan.K, of_command.K)
    assert plan.size == (640, 480) and plan.expected == of_command.expected
    assert plan.poses[:, 2, 3].min() >= -0.5 and plan.poses[:, 0, 3].max() <= 1.5
    # What trimesh has: an object with vertices and faces.
    mesh = SimpleNamespace(vertices=ball[0], faces=ball[1])
    again = camsplat.plan(mesh, views=9, seed=3, floor=-0.5, wall=walls, size=(640, 480), fov=60)
    assert np.array_equal(again.poses, plan.poses)
    scored = camsplat.score(mesh, plan, seed=3)
    subprocess.run(
        [sys.executable, "-m", "camsplat", "score", "ball.ply", "plan", "--seed", "3", "--json", "score.json"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    assert json.loads((tmp_path / "score.json").read_text())["expected"]["db"] == scored.db


def test_kept_cameras_count_and_stay(ball: Ball) -> None:
    """If this failed, a second plan would move the first one's cameras, or not know of them."""
    first = camsplat.plan(*ball, views=5, **QUICK)
    second = camsplat.plan(*ball, views=4, keep=first, **QUICK)
    assert (len(second.cameras), len(second.kept)) == (4, 5)
    assert np.allclose(second.kept.poses, first.poses, atol=1e-12)
    assert not np.allclose(second.poses, camsplat.plan(*ball, views=4, **QUICK).poses)
    by_cameras = camsplat.plan(*ball, views=4, keep=first.cameras, **QUICK)
    assert np.array_equal(by_cameras.poses, second.poses)
    by_poses = camsplat.plan(*ball, views=4, keep=first.poses, viewers=first.poses, **QUICK)
    same = camsplat.plan(*ball, views=4, keep=first, viewers=first, **QUICK)
    assert np.array_equal(by_poses.poses, same.poses) and np.allclose(by_poses.kept.K, first.cameras.K)


def test_a_plan_that_is_a_simple_layout_says_so(ball: Ball) -> None:
    """If this failed, +0.00 dB would look like a planner that did nothing."""
    plan = camsplat.plan(*ball, views=5, **QUICK)
    is_layout = plan.expected == 0.0
    assert is_layout == (plan.reason is not None) and is_layout == ("the plan is that layout itself" in repr(plan))


def test_progress_is_reported_and_other_threads_run(ball: Ball, caplog: pytest.LogCaptureFixture) -> None:
    """If this failed, a notebook would freeze while it plans, and show nothing."""
    ticks = 0
    ended = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not ended.wait(0.001):
            ticks += 1

    thread = threading.Thread(target=tick)
    thread.start()
    calls: list[tuple[str, int, int]] = []
    before = time.monotonic()
    with caplog.at_level(logging.INFO, logger="camsplat"):
        camsplat.plan(*ball, views=40, iterations=300, progress=lambda *call: calls.append(call))
    seconds = time.monotonic() - before
    ended.set()
    thread.join()
    # Were the lock held, the thread would run only while callbacks do.
    assert ticks > 100 * seconds, f"{ticks} ticks in {seconds:.1f} s"
    assert calls[-1] == ("planning", 300, 300) and sorted(call[1] for call in calls) == [call[1] for call in calls]
    assert any(record.message.startswith("expected") for record in caplog.records)


def test_what_a_callback_raises_stops_the_run(ball: Ball, tmp_path: Path) -> None:
    """If this failed, a mistake in a callback would be lost, or the run go on without its caller."""

    class Mistake(Exception):
        pass

    calls: list[int] = []

    def progress(doing: str, done: int, total: int) -> None:
        if doing == at:
            calls.append(done)
            raise Mistake

    at = "preparing"
    with pytest.raises(Mistake):
        camsplat.plan(*ball, views=50, iterations=10**6, out=tmp_path / "plan", progress=progress)
    assert not (tmp_path / "plan").exists() and len(calls) == 1, "there was no plan yet"
    at, calls = "planning", []
    with pytest.raises(Mistake):
        camsplat.plan(*ball, views=50, iterations=10**6, out=tmp_path / "plan", progress=progress)
    assert camsplat.Plan(tmp_path / "plan").record["status"] == "interrupted" and len(calls) == 1


def test_ctrl_c_stops_a_plan_and_keeps_it(ball: Ball, tmp_path: Path) -> None:
    """If this failed, a cell of a notebook could not be interrupted, or what it had would be lost."""
    np.save(tmp_path / "vertices.npy", ball[0])
    program = (
        "import camsplat, numpy as np\n"
        "def progress(doing, done, total): doing == 'planning' and print('going', flush=True)\n"
        "camsplat.plan(np.load('vertices.npy'), views=50, iterations=10**6, out='plan', progress=progress)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "going\n"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in errors, errors
    assert camsplat.Plan(tmp_path / "plan").record["status"] == "interrupted"


def test_a_stopped_plan_that_nobody_gets_is_not_scored(ball: Ball, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If this failed, Ctrl-C in a notebook would be followed by seconds of work on a plan that is thrown away."""

    class Stop(Exception):
        pass

    def progress(doing: str, done: int, total: int) -> None:
        if doing == "planning":
            raise Stop

    # A folder that outlives the call.
    monkeypatch.setattr(camsplat._show, "Temporary", lambda: SimpleNamespace(folder=tmp_path))
    with pytest.raises(Stop):
        camsplat.plan(*ball, views=50, iterations=10**6, progress=progress)
    assert not (tmp_path / "plan").exists()
    camsplat.plan(*ball, views=5, **QUICK)
    assert (tmp_path / "plan/plan.json").is_file()


def test_a_forked_process_is_refused_and_not_left_waiting(ball: Ball, tmp_path: Path) -> None:
    """If this failed, a pool of forked workers would hang without a word."""
    np.save(tmp_path / "vertices.npy", ball[0])
    program = (
        "import camsplat, multiprocessing, numpy as np\n"
        "vertices = np.load('vertices.npy')\n"
        "def work(queue):\n"
        "    try: camsplat.plan(vertices, views=4, iterations=5, held_out=50)\n"
        "    except camsplat.Error as error: queue.put(str(error))\n"
        "camsplat.plan(vertices, views=4, iterations=5, held_out=50)\n"
        "fork = multiprocessing.get_context('fork')\n"
        "queue = fork.SimpleQueue()\n"
        "process = fork.Process(target=work, args=(queue,))\n"
        "process.start(); process.join(); print(queue.get())\n"
    )
    ran = subprocess.run(
        [sys.executable, "-W", "error::ResourceWarning", "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert 'the method "spawn"' in ran.stdout and "ResourceWarning" not in ran.stderr, ran


def test_threads_plan_side_by_side(ball: Ball) -> None:
    """If this failed, two plans at once would take each other's options, progress or stops."""
    alone = [camsplat.plan(*ball, views=6, seed=seed, **QUICK).poses for seed in range(3)]
    together: dict[int, Floats] = {}

    def work(seed: int) -> None:
        together[seed] = camsplat.plan(*ball, views=6, seed=seed, **QUICK).poses

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(together[seed], alone[seed]) for seed in range(3))


def test_a_curve_rises_with_views(ball: Ball) -> None:
    """If this failed, nobody could ask from Python how many views are worth taking."""
    curve = camsplat.quality_curve(*ball, **QUICK)
    assert list(curve.views) == sorted(curve.views) and curve.views[-1] == 300
    assert curve.db[-1] == 0 and curve.db[0] < curve.db[5] < 0 and curve._repr_svg_().startswith("<svg")


def test_plans_are_shown_and_handed_on(ball: Ball, tmp_path: Path) -> None:
    """If this failed, what a trainer or a notebook gets of a plan would not be the plan."""
    plan = camsplat.plan(*ball, views=5, **QUICK)
    frames = plan.to_nerfstudio()["frames"]
    poses = np.array([frame["transform_matrix"] for frame in sorted(frames, key=lambda frame: str(frame["file_path"]))])
    assert np.allclose(poses, plan.cameras.poses_opengl, atol=1e-9)
    assert plan.to_colmap(tmp_path / "colmap") == tmp_path / "colmap" / "sparse" / "0"
    assert np.allclose(camsplat.read_cameras(tmp_path / "colmap").poses, plan.poses, atol=1e-9)
    plan.save(tmp_path / "kept")
    with pytest.raises(camsplat.Error, match="already"):
        plan.save(tmp_path / "kept")
    with pytest.raises(camsplat.Error, match=r"call save\(\)"):
        pickle.dumps(plan)
    assert np.array_equal(pickle.loads(pickle.dumps(camsplat.Plan(tmp_path / "kept"))).poses, plan.poses)
    assert np.array_equal(camsplat.Plan(tmp_path / "kept").poses, plan.poses)
    page = plan._frame(400)
    assert page.startswith("<iframe") and "&lt;html" in page and "<html" not in page
    temporary = plan.folder
    del plan
    assert not temporary.exists() and (tmp_path / "kept" / "report.html").exists()


def test_other_viewers_get_the_cameras(ball: Ball) -> None:
    """If this failed, rerun and viser would show cameras somewhere else."""
    plan = camsplat.plan(*ball, views=5, **QUICK)
    viser = pytest.importorskip("viser", reason="skipped: viser is not installed")
    from viser.transforms import SO3

    server = viser.ViserServer(port=0, verbose=False)
    try:
        plan.to_viser(server)
        handles = [handle for name, handle in server.scene._handle_from_node_name.items() if "/cameras/" in name]
        assert len(handles) == 5
        assert np.allclose([handle.position for handle in handles], plan.cameras.positions)
        turned = np.array([SO3(handle.wxyz).as_matrix() for handle in handles])
        assert np.allclose(turned, plan.poses[:, :3, :3], atol=1e-9)
    finally:
        server.stop()


def test_rerun_takes_the_cameras(ball: Ball, tmp_path: Path) -> None:
    """If this failed, a recording would hold no cameras, or rerun refuse them."""
    rerun = pytest.importorskip("rerun", reason="skipped: rerun is not installed")
    plan = camsplat.plan(*ball, views=5, **QUICK)
    recording = rerun.RecordingStream("camsplat")
    recording.save(str(tmp_path / "plan.rrd"))
    plan.log_to_rerun("scene", recording=recording)
    recording.flush()
    assert (tmp_path / "plan.rrd").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"views": 0}, "views is 0; give at least 1"),
        ({"box": (1, 2, 3)}, "box takes 6 numbers"),
        ({"preset": "rom"}, "possible values: object, room"),
        ({"faces": np.array([[0, 1, 10**6]])}, "there are"),
        ({"faces": np.array([[0, 1], [1, 2]])}, "give (F, 3)"),
        ({"scene": np.zeros((5, 2))}, "(N, 3)"),
        ({"scene": np.full((5, 3), np.inf)}, "vertices[0] is not finite"),
        ({"scene": np.zeros((0, 3))}, "there are none"),
        ({"scene": "nowhere.ply"}, "nowhere.ply: there is no such file"),
        ({"keep": np.eye(4)}, "keep: poses: the shape is (4, 4)"),
        ({"scene": {}}, "the surface is a dict; give"),
        ({"scene": None}, "the surface is a NoneType; give"),
        # A path of trimesh, lines of open3d.
        ({"scene": SimpleNamespace(vertices=np.eye(3), entities=[])}, "the surface is a SimpleNamespace; give"),
        ({"scene": SimpleNamespace(points=np.eye(3), lines=np.zeros((0, 2)))}, "the surface is a SimpleNamespace; give"),
        ({"scene": (np.eye(3), np.eye(3))}, "faces: the shape is (3, 3), of float64"),
        ({"floor": (1, 2)}, "see help(camsplat.plan)"),
        ({"device": "no such device"}, "no such device"),
        ({"progress": "yes"}, "progress is 'yes'"),
        ({"size": (640.5, 480)}, "640.5"),
        ({"size": {640, 480}}, "size is a set"),
        ({"scene": np.zeros((5, 3))}, "scene: "),
    ],
)
def test_requests_that_make_no_sense_are_refused(ball: Ball, arguments: dict[str, object], message: str) -> None:
    """If this failed, a mistake would become a wrong plan, or an error that nobody understands."""
    with pytest.raises(camsplat.Error) as raised:
        camsplat.plan(**{"scene": ball[0], **arguments})  # type: ignore[arg-type]
    assert message in str(raised.value) and "\n" not in str(raised.value)


def test_misspelt_keywords_and_full_folders_are_refused(ball: Ball, tmp_path: Path) -> None:
    """If this failed, an option would be lost without a word, or somebody's files with it."""
    with pytest.raises(TypeError, match="veiws"):
        camsplat.plan(ball[0], veiws=5)  # type: ignore[call-arg]
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(camsplat.Error, match="not empty; pass force=True to"):
        camsplat.plan(ball[0], views=5, out=tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["mine.txt"]
    camsplat.plan(ball[0], views=5, out=tmp_path, force=True)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    plan = camsplat.plan(ball[0], views=4)
    with pytest.raises(camsplat.Error, match="force=True"):
        plan.save(tmp_path)
    plan.save(tmp_path, force=True)
    assert (tmp_path / "mine.txt").read_text() == "mine" and len(camsplat.Plan(tmp_path).cameras) == 4
    with pytest.raises(camsplat.Error, match="this is the folder"):
        plan.save(plan.folder, force=True)
    shutil.rmtree(tmp_path)
    with pytest.raises(camsplat.Error, match=r"plan\.json"):
        camsplat.Plan(tmp_path)


def test_meshes_of_other_libraries_are_taken_for_what_they_are(ball: Ball) -> None:
    """If this failed, a mesh would silently be planned for as its points, its parts would stand elsewhere, or be refused."""
    vertices, faces = ball
    known = camsplat.plan(*ball, views=4, **QUICK).poses
    of_points = camsplat.plan(vertices, views=4, **QUICK).poses
    assert not np.allclose(known, of_points)
    meshes: dict[str, object] = {
        "arrays": (vertices, faces),
        "lists": (vertices.tolist(), faces.tolist()),
        "open3d": SimpleNamespace(vertices=vertices, triangles=faces),
    }
    clouds: dict[str, object] = {"open3d": SimpleNamespace(points=vertices), "no faces": (vertices, None), "none": (vertices, faces[:0])}
    try:
        import trimesh  # optional
    except ImportError:
        pass
    else:
        # The ball is elsewhere in its own file, and its node brings it back.
        mesh = trimesh.Trimesh(vertices - [3, 0, 0], faces, process=False)
        scene = trimesh.Scene()
        scene.add_geometry(mesh, transform=np.block([[np.eye(3), np.array([[3.0], [0], [0]])], [np.zeros((1, 3)), np.ones((1, 1))]]))
        meshes["trimesh"], meshes["scene of trimesh"] = trimesh.Trimesh(vertices, faces, process=False), scene
        clouds["trimesh"] = trimesh.PointCloud(vertices)  # type: ignore[no-untyped-call]
    try:
        import pyvista  # optional
    except ImportError:
        pass
    else:
        triangles = pyvista.PolyData.from_regular_faces(vertices, faces)
        meshes["pyvista"], meshes["grid of pyvista"] = triangles, triangles.cast_to_unstructured_grid()
        clouds["pyvista"] = pyvista.PolyData(vertices)
    for name, one in meshes.items():
        poses = camsplat.plan(one, views=4, **QUICK).poses  # type: ignore[arg-type]
        assert np.allclose(poses, known, atol=1e-6), name
    for name, cloud in clouds.items():
        poses = camsplat.plan(cloud, views=4, **QUICK).poses  # type: ignore[arg-type]
        assert np.allclose(poses, of_points, atol=1e-6), name


def test_up_is_that_of_the_file_a_mesh_is_from(ball: Ball, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """If this failed, a room of a glTF file would lie on its side as soon as a script had loaded it, without a word."""
    vertices, faces = ball

    def up_of(plan: camsplat.Plan) -> list[float]:
        up: list[float] = plan.record["region"]["up"]
        return up

    with caplog.at_level(logging.INFO, logger="camsplat"):
        loaded = SimpleNamespace(vertices=vertices, faces=faces, metadata={"from_gltf_primitive": False})
        assert up_of(camsplat.plan(loaded, views=4, **QUICK)) == [0, 1, 0]
        assert up_of(camsplat.plan(loaded, views=4, up="x", **QUICK)) == [1, 0, 0]
        assert up_of(camsplat.plan(ball, views=4, **QUICK)) == [0, 0, 1]
    said = [line for line in caplog.messages if line.startswith("up ")]
    assert len(said) == 2 and "+y, as in the glTF file" in said[0] and "+z, as no file says" in said[1], said
    trimesh = pytest.importorskip("trimesh", reason="skipped: trimesh is not installed")
    file = tmp_path / "ball.glb"
    trimesh.Trimesh(vertices, faces, process=False).export(file)
    known = camsplat.plan(file, views=4, **QUICK)
    for mesh in (trimesh.load_scene(file), trimesh.load_mesh(file)):
        plan = camsplat.plan(mesh, views=4, **QUICK)
        assert up_of(plan) == [0, 1, 0] and np.allclose(plan.poses, known.poses, atol=1e-6)


def test_poses_are_scored_with_their_lens(ball: Ball) -> None:
    """If this failed, one could not ask what poses are worth, or would be answered for another lens."""
    plan = camsplat.plan(*ball, views=5, fov=60, size=(640, 480), **QUICK)
    known = camsplat.score(ball, plan.cameras, held_out=50).db
    assert camsplat.score(ball, plan.poses, size=(640, 480), fov=60, held_out=50).db == pytest.approx(known, abs=1e-6)
    assert camsplat.score(ball, plan.poses, size=(640, 480), K=plan.K, held_out=50).db == pytest.approx(known, abs=1e-6)
    assert camsplat.score(ball, plan.poses, size=(640, 480), fov=30, held_out=50).db != pytest.approx(known, abs=1e-3)
    with pytest.raises(camsplat.Error, match="have their own"):
        camsplat.score(ball, plan, fov=60)


@pytest.mark.parametrize(
    "function", [camsplat.plan, camsplat.score, camsplat.quality_curve, camsplat.select, camsplat.train, camsplat.evaluate]
)
def test_options_are_listed(function: Callable[..., object]) -> None:
    """If this failed, `help` and completion would not show what a function takes, or `get_type_hints` fail."""
    parameters = inspect.signature(function).parameters
    hints = get_type_hints(function)
    assert "options" not in parameters and set(hints) == {*parameters, "return"}
    assert parameters["device"].default is None and hints["device"] == Union[str, int]
