"""The table of deviations, and the programs that are run for it."""
import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

# Bounds: pixels of projections, the same of programs in single precision, and shares of the size of what a file shows.
PIXELS, SINGLE, SHARE = 1e-3, 0.02, 1e-6
MODULES = Path(os.environ.get("NODE_MODULES", "node_modules")).resolve()


class Table:
    """Lines of file, reader, largest deviation and remark, and those that are beyond their bounds."""

    def __init__(self):
        self.lines, self.faults = [], []

    def add(self, file, reader, what, deviation, unit, bound, remark=""):
        """A deviation that is not a number is beyond every bound."""
        good = bool(deviation <= bound)
        remarks = [f"**beyond {bound:g}**"] * (not good) + [remark] * bool(remark)
        self.lines.append(f"| {file} | {reader} | {what}: {deviation:.2g} {unit} | {'; '.join(remarks)} |")
        print(self.lines[-1], flush=True)
        if not good:
            self.faults.append(f"{file}, read by {reader}: {what} off by {deviation:.3g} {unit}, more than {bound:g}")

    def text(self):
        return "\n".join(["| file | read by | largest deviation | remark |", "|---|---|---|---|", *self.lines, ""])

    def verdict(self):
        """One line where something is beyond its bound."""
        return f"{len(self.faults)} of {len(self.lines)} deviations are beyond their bounds: {self.faults[0]}" if self.faults else None


TABLE = Table()
row = TABLE.add


def by(*packages):
    """Names and versions of Python packages."""
    return ", ".join(f"{package} {version(package)}" for package in packages)


def off(a, b):
    """Largest distance between the points of two lists of one length."""
    return np.linalg.norm(np.asarray(a, float) - np.asarray(b, float), axis=-1).max() if len(a) == len(b) else np.nan


def program(*arguments, required=True):
    """Runs a program and says whether it came through; where it fails, what it prints last is said."""
    command = [str(argument) for argument in arguments]
    done = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        said = f"{' '.join(command)}: {(done.stdout.strip().splitlines() or ['failed'])[-1]}"
        if required:
            sys.exit(said)
        print(f"left out: {said}")
    return done.returncode == 0


def package(name):
    """Folder and version of a package of Node.js."""
    folder = MODULES / name
    return folder, json.loads((folder / "package.json").read_text())["version"]
