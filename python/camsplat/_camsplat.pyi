"""The native part, see python/src."""

import os
from collections.abc import Callable, Sequence
from typing import Optional, Union

import numpy as np
import numpy.typing as npt

__version__: str

class Error(RuntimeError): ...

def main(arguments: Sequence[str]) -> int: ...
def run(
    arguments: Sequence[str],
    on_line: Callable[[str], object],
    on_progress: Callable[[str, int, int], object],
    drops_parts: bool = False,
) -> None: ...
def read_cameras(
    path: Union[str, os.PathLike[str]],
) -> tuple[list[str], npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.uint32], list[str]]: ...
def write_cameras(
    path: Union[str, os.PathLike[str]],
    names: Sequence[str],
    poses: npt.NDArray[np.float64],
    lenses: npt.NDArray[np.float64],
    sizes: npt.NDArray[np.uint32],
) -> None: ...
def write_capture(
    path: Union[str, os.PathLike[str]],
    names: Sequence[str],
    poses: npt.NDArray[np.float64],
    lenses: npt.NDArray[np.float64],
    sizes: npt.NDArray[np.uint32],
    points: npt.NDArray[np.float64],
    colours: npt.NDArray[np.uint8],
) -> None: ...
def read_surface(
    path: Union[str, os.PathLike[str]],
) -> tuple[npt.NDArray[np.float64], Optional[npt.NDArray[np.uint32]], list[str]]: ...
def render(
    model: Union[str, os.PathLike[str]],
    names: Sequence[str],
    poses: npt.NDArray[np.float64],
    lenses: npt.NDArray[np.float64],
    sizes: npt.NDArray[np.uint32],
    background: tuple[float, float, float],
    alpha: bool,
    depth: bool,
    antialiased: bool,
    near: Optional[float],
    device: Optional[str],
) -> list[tuple[npt.NDArray[np.float32], Optional[npt.NDArray[np.float32]]]]: ...
