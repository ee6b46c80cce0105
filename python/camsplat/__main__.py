"""The command line: `camsplat`, or `python -m camsplat`."""

import sys

from ._camsplat import main as run


def main() -> None:
    """Runs the command line with the process's arguments and exits with its code."""
    sys.exit(run(["camsplat", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
