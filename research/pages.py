#!/usr/bin/env python3
"""What the page of `camsplat watch` says of real captures, played back as folders of photos alone, with pictures of it on a phone's screen.

usage: pages.py CAMSPLAT PYTHON OUT CAPTURE...

The photos of each CAPTURE/images arrive in the order of their names: 5, 20, and all. PYTHON has pycolmap. Writes OUT/NAME-COUNT.png by
headless chromium and prints a line each: photos, photos that are placed, answer, gain, its deviation, share of what viewers look at that no
photo shows, flaws, seconds.
"""
import json
import shutil
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

BROWSER = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=390,3600"]
BROWSER += ["--virtual-time-budget=6000"]


def settled(board, count):
    """Whether the page is up to date with so many photos."""
    done = board["stage"].startswith(("Up to date", "No two photos", "Take five"))
    return board["photos"] == count and done and (board["advice"] is None or f"with {count} photos" in board["stage"])


def play(camsplat, python, out, capture):
    images = sorted((capture / "images").iterdir())
    place = out / f"{capture.name}-in"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    watch = subprocess.Popen([camsplat, "watch", place, "--no-browser", "--python", python], stdout=subprocess.PIPE, text=True)
    url = next(line.split()[1].rstrip(",") for line in watch.stdout if line.startswith("page"))
    done = 0
    for count in (5, 20, len(images)):
        start = time.time()
        for image in images[done:count]:
            shutil.copyfile(image, place / image.name)
        done, before = count, None
        # The page may be up to date with what it had before it has seen these.
        while True:
            time.sleep(1)
            board = json.loads(urllib.request.urlopen(f"{url}board/-1").read())
            if settled(board, count) and board["version"] == before:
                break
            before = board["version"]
        taken = time.time() - start
        subprocess.run([*BROWSER, f"--screenshot={out}/{capture.name}-{count}.png", url], check=True, capture_output=True)
        advice = board["advice"] or {"enough": "-", "gain_db": 0, "gain_sd_db": 0, "unseen": 1}
        numbers = [f"{advice[name]:.2f}" for name in ("gain_db", "gain_sd_db", "unseen")]
        print(capture.name, count, board["posed"], advice["enough"], *numbers, len(board["flaws"]), f"{taken:.0f} s", flush=True)
    watch.send_signal(2)
    watch.communicate()


if __name__ == "__main__":
    camsplat, python, out, *captures = sys.argv[1:]
    Path(out).mkdir(exist_ok=True)
    for capture in captures:
        play(camsplat, python, Path(out), Path(capture))
