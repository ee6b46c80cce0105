"""Where should the cameras stand?

camsplat places N cameras around an object or in a room so that a radiance field trained on their photos is as good as it can be.

>>> import numpy as np, camsplat
>>> angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
>>> column = np.stack([np.cos(angle), np.sin(angle), np.linspace(0, 3, 500)], axis=1)
>>> plan = camsplat.plan(column, views=12, floor=0, seed=1)
>>> plan.cameras.poses.shape  # world from camera; OpenCV axes: x right, y down, z forward
(12, 4, 4)

Every function runs the command of the same name inside the interpreter and takes its options as keywords: `--max-splats 50000` is
`max_splats=50000`, a flag is `True`, numbers between commas are a tuple. What fails raises `Error`, with the line that the
command prints, options as keywords. The interpreter's lock is released meanwhile, and Ctrl-C stops what is running.
"""

from ._cameras import Cameras, read_cameras, read_surface
from ._camsplat import Error, __version__
from ._command import command
from ._photos import Evaluation, Rendering, Selection, Training, evaluate, render, select, train
from ._plan import Plan, QualityCurve, Score, plan, quality_curve, score
from ._session import Session

__all__ = [
    "Cameras",
    "Error",
    "Evaluation",
    "Plan",
    "QualityCurve",
    "Rendering",
    "Score",
    "Selection",
    "Session",
    "Training",
    "__version__",
    "command",
    "evaluate",
    "plan",
    "quality_curve",
    "read_cameras",
    "read_surface",
    "render",
    "score",
    "select",
    "train",
]
