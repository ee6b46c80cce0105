"""Commands: keywords become options, lines go to the logger `camsplat`, progress to a bar or a callback."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np

from . import _camsplat, _options

Progress = Union[bool, Callable[[str, int, int], object]]
"""`True` for a bar (needs tqdm), or a function of what is being done, the units that are done, and all of them."""

_FUNCTIONS = {
    "plan": _options.PlanOptions,
    "score": _options.ScoreOptions,
    "select": _options.SelectOptions,
    "train": _options.TrainOptions,
    "evaluate": _options.EvaluateOptions,
    "next": _options.NextOptions,
}
"""Commands that are functions, or a class, and their options."""

_FLAGS = {
    name
    for options in _FUNCTIONS.values()
    for name, kind in options.__annotations__.items()
    if getattr(kind, "__forward_arg__", kind) in ("bool", bool)
}
"""Options without a value."""

_logger = logging.getLogger("camsplat")


def command(name: str, /, *arguments: Union[str, os.PathLike[str]], progress: Progress = False, **options: Any) -> list[str]:
    """Runs any command of the command line, and returns the lines that it prints.

    The lines go to the logger `camsplat` as well, with options as keywords, warnings among them at the level WARNING. `name` may have
    several words, such as "vdsf fit". Options are keywords: `max_splats=50000`; `True` for a flag; a tuple of numbers for numbers between
    commas; a list of words, files or tuples for an option that is repeated. What is `None` or `False` is left out.

    >>> camsplat.command("export", "plan", out="mission", format="ros")  # doctest: +SKIP

    Raises `Error` with the line that the command prints where it fails.
    """
    return run(name, arguments, options, progress)


def run(
    name: str,
    arguments: Sequence[Union[str, os.PathLike[str]]],
    options: Mapping[str, Any],
    progress: Progress,
    temporary: Optional[Path] = None,
    drops_parts: bool = False,
) -> list[str]:
    """As `command`; an error about a file in the folder `temporary`, which stands for an argument, names the argument. Where it
    `drops_parts`, a run that is stopped makes no effort to finish what it has."""
    if not isinstance(progress, bool) and not callable(progress):
        raise _camsplat.Error(f"progress is {progress!r}; give True, False or a function of what is done, the units done, and all of them")
    lines: list[str] = []

    def on_line(line: str) -> None:
        lines.append(line)
        _logger.log(logging.WARNING if line.startswith(("warning", "validation")) else logging.INFO, "%s", in_python(line, name))

    words = [*name.split(), *options_of(options)]
    if arguments:
        words += ["--", *(os.fspath(argument) for argument in arguments)]
    with _Bar() if progress is True else _Callback(progress) as on_progress:
        try:
            _camsplat.run(words, on_line, on_progress, drops_parts)
        except _camsplat.Error as error:
            message = str(error)
            if temporary is not None:
                argument = re.compile(re.escape(str(temporary) + os.sep) + r"(\w+)\.(?:ply|json)\b")
                message = argument.sub(r"\1", message)
            raise _camsplat.Error(in_python(message, name)) from None
    return lines


def in_python(message: str, name: str) -> str:
    """A line of the command `name` with its options as keywords.

    >>> in_python("plan: there is something here already; give --force, or --max-splats 9; see --help", "plan")
    'plan: there is something here already; give force=True, or max_splats 9; see help(camsplat.plan)'
    """
    help_of = f"help(camsplat.{'Session' if name == 'next' else name})" if name in _FUNCTIONS else f"`camsplat {name} --help`"
    message, is_helpless = message.removesuffix("; see --help"), message.endswith("; see --help")

    def keyword(option: re.Match[str]) -> str:
        word = option[1].replace("-", "_")
        return f"{word}=True" if word in _FLAGS else word

    message = re.sub(r"(?<![\w/.-])--([a-z][a-z0-9]*(?:-[a-z0-9]+)*)", keyword, message)
    return f"{message}; see {help_of}" if is_helpless else message


def options_of(options: Mapping[str, Any]) -> list[str]:
    """Options as the command line has them.

    >>> options_of({"views": 50, "size": (640, 480), "wall": [(0, 0, 0, 1, 0, 0), (0, 0, 0, 0, 1, 0)], "force": True, "box": None})
    ['--views=50', '--size=640x480', '--wall=0,0,0,1,0,0', '--wall=0,0,0,0,1,0', '--force']
    """
    words = []
    for name, value in options.items():
        if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
            value = value.item()
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(option)
        elif isinstance(value, (bytes, set, frozenset, Mapping)):
            raise _camsplat.Error(f"{name} is a {type(value).__name__}; give text, a number, or a tuple or list of these")
        elif name == "size" and not isinstance(value, (str, int)):
            words.append(f"{option}={'x'.join(_whole(side) for side in _texts(value)[0].split(','))}")
        else:
            words += [f"{option}={text}" for text in _texts(value)]
    return words


def _whole(text: str) -> str:
    """A number of pixels: 640.0 is 640, and 640.5 stays for the command to refuse."""
    return text[:-2] if text.endswith(".0") else text


def _texts(value: Any) -> list[str]:
    """The values of an option: one for each time that it is given."""
    if isinstance(value, (str, os.PathLike)) or not hasattr(value, "__iter__"):
        return [_text(value)]
    values = list(value)
    if not values:
        return []
    if all(not isinstance(part, (str, os.PathLike)) and not hasattr(part, "__iter__") for part in values):
        return [",".join(_text(part) for part in values)]
    return [text for part in values for text in _texts(part)]


def _text(value: Any) -> str:
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


class _Callback:
    """Calls a function of the user's, if there is one."""

    def __init__(self, progress: Union[bool, Callable[[str, int, int], object]]) -> None:
        self.progress = progress

    def __enter__(self) -> Callable[[str, int, int], object]:
        return self.progress if callable(self.progress) else lambda doing, done, total: None

    def __exit__(self, *exception: object) -> None:
        pass


class _Bar:
    """A bar of tqdm, made when there is something to show."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm  # optional
        except ImportError:
            raise _camsplat.Error('progress=True needs tqdm; pip install "camsplat[progress]"') from None

        self.make = tqdm
        self.bar: Any = None

    def __enter__(self) -> Callable[[str, int, int], object]:
        return self.show

    def show(self, doing: str, done: int, total: int) -> None:
        if self.bar is None:
            self.bar = self.make(total=total)
        if self.bar.total != total:
            self.bar.reset(total)
        self.bar.set_description(doing, refresh=False)
        self.bar.update(done - self.bar.n)

    def __exit__(self, *exception: object) -> None:
        if self.bar is not None:
            self.bar.close()
