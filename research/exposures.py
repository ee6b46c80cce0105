#!/usr/bin/env python3
"""What learning exposures (`camsplat train --exposure`) is worth: rendered walks whose exposure and white balance drift, and captures.

usage: exposures.py CAMSPLAT OUT [CAPTURE ...]

Walks c, e and f of frames_walk.py, 72 frames each at even times with their true poses, photographed by `camsplat capture` at 64 samples.
Drift: gains in linear light of half a stop to either side, as frames_walk.py has them, and of 7% between red and blue. Each walk is trained
with and without drift and option; 30 sharp views beside the walk, without drift, are tested with. Captures hold out every eighth photo.
Means and standard deviations over seeds: two for walks, four for captures. Test views of `--exposure` are shown with an exposure that is
fitted to the other half of the picture, so both kinds of runs are also compared under such fits: figures "fitted" of runs without the
option are made here in the same way.
Needs numpy and pillow. docs/results/exposure.md has what came out.
"""
import json
import os
import subprocess
import sys

import numpy as np
from PIL import Image

import frames_walk

FRAMES, ITERATIONS, SPLATS = 72, 7000, 100_000


def run(*command):
    """Runs a command; ends where it fails."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")


def gains(i):
    """Gains of red, green and blue in linear light."""
    stops = 0.5 * (0.7 * np.sin(0.06 * 3 * i) + 0.3 * np.sin(0.23 * 3 * i + 1))
    tint = 0.07 * np.sin(0.11 * 3 * i + 2)
    return 2**stops * np.array([1 + tint, 1, 1 - tint])


def drift(images):
    """Gives the photos of a folder the drift, in the order of their names."""
    for i, file in enumerate(sorted(os.listdir(images))):
        picture = np.asarray(Image.open(f"{images}/{file}").convert("RGB"), float) / 255
        shown = (255 * np.clip(gains(i) * picture**2.2, 0, 1) ** (1 / 2.2)).round()
        Image.fromarray(shown.astype(np.uint8)).save(f"{images}/{file}")


def walk(camsplat, name, out):
    """Photographs a walk; folders of its photos with and without drift."""
    folder = f"{out}/{name}"
    frames_walk.make(folder, name)
    groups = json.load(open(f"{folder}/groups.json"))
    chosen = [groups[round(i)]["pose"] for i in np.linspace(0, len(groups) - 1, FRAMES)]
    with open(f"{folder}/still.json", "w") as file:
        json.dump(frames_walk.cameras([np.array(pose) for pose in chosen]), file)
    for cameras in ("still", "tests"):
        run(camsplat, "capture", f"{folder}/room.gltf", f"{folder}/{cameras}.json", "--out", f"{folder}/{cameras}", "--spp", 64, "--force")
    run("rm", "-rf", f"{folder}/drift")
    run("cp", "-r", f"{folder}/still", f"{folder}/drift")
    drift(f"{folder}/drift/images")
    return folder


def fitted(rendered, reference):
    """PSNR of a picture whose halves each have the affine colours that fit the other half best."""
    half = rendered.shape[1] // 2
    shown = np.empty_like(rendered)
    for own, other in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
        x = np.c_[rendered[:, other].reshape(-1, 3), np.ones(rendered[:, other].size // 3)]
        weight = 1e-4 * len(x) * np.eye(4)
        found = np.linalg.solve(x.T @ x + weight, x.T @ reference[:, other].reshape(-1, 3) + weight[:, :3])
        shown[:, own] = rendered[:, own] @ found[:3] + found[3]
    error = np.mean((np.clip(shown, 0, 1) - reference) ** 2)
    return -10 * np.log10(error)


def seeds(count, *arguments):
    """What `train` gives with several seeds: both figures of each, and the last record."""
    runs = [train(*arguments, "--seed", seed) for seed in range(count)]
    return np.array([run[:2] for run in runs]), runs[-1][2]


def row(name, plain, learnt):
    """A row of the table."""
    gains = learnt[:, 1] - plain[:, 1]
    words = [f"{plain[:, 0].mean():.2f}", f"{plain[:, 1].mean():.2f}", f"{learnt[:, 1].mean():.2f}", f"{gains.mean():+.2f} ± {gains.std(ddof=1):.2f}"]
    print("|", " | ".join([name, *words]), "|", flush=True)


def train(camsplat, capture, out, *options):
    """PSNR as the run has it and under fitted exposures, and the run's record."""
    run(camsplat, "train", capture, "--out", out, "--force", "--iterations", ITERATIONS, "--max-splats", SPLATS, "--evaluate-every", 0, *options)
    record = json.load(open(f"{out}/train.json"))
    own = np.mean([view["quality"]["psnr"] for view in record["test_views"]])
    if "--exposure" in options:
        return own, own, record
    pictures = lambda of: [np.asarray(Image.open(f"{out}/{of}/{name}").convert("RGB"), float) / 255 for name in sorted(os.listdir(f"{out}/{of}"))]
    return own, np.mean([fitted(a, b) for a, b in zip(pictures("test"), pictures("reference"))]), record


def plot(out):
    """Draws learnt and true gains of the walks: exposure.svg."""
    walks = {name: json.load(open(f"{out}/gains-{name}.json")) for name in "cef"}
    width, height, high = 760, 150, 0.3
    parts = []
    for i, (name, gains) in enumerate(walks.items()):
        top = i * (height + 30) + 24
        place = lambda k, v: f"{60 + (width - 80) * k / (FRAMES - 1):.1f},{top + height / 2 * (1 - v / high):.1f}"
        line = " ".join(place(k, v) for k, v in enumerate(gains["true"]))
        dots = "".join("<circle cx='%s' cy='%s' r='2.6'/>" % tuple(place(k, v).split(",")) for k, v in enumerate(gains["found"]))
        marks = "".join(
            f"<text x='52' y='{top + height / 2 * (1 - v / high) + 4:.1f}' text-anchor='end'>{v:+.1f}</text>"
            f"<path d='M60 {top + height / 2 * (1 - v / high):.1f}H{width - 20}' stroke='#ddd'/>" for v in (-0.2, 0, 0.2))
        parts.append(f"<text x='60' y='{top - 8}' font-weight='600'>walk {name}</text>{marks}"
                     f"<polyline points='{line}' fill='none' stroke='#d4660a' stroke-width='1.6'/><g fill='#2962d9'>{dots}</g>")
    tall = 3 * (height + 30) + 30
    keys = (f"<text x='60' y='{tall - 8}'>72 photos in their order; gain of grey as log2 in sRGB: "
            "<tspan fill='#d4660a'>line: true</tspan>, <tspan fill='#2962d9'>dots: learnt</tspan></text>")
    with open(f"{out}/exposure.svg", "w") as file:
        file.write(f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {tall}' font-family='sans-serif' font-size='13'>"
                   f"<rect width='{width}' height='{tall}' fill='white'/>{''.join(parts)}{keys}</svg>\n")


def main():
    """Makes the tables."""
    camsplat, out, *captures = sys.argv[1:]
    os.makedirs(out, exist_ok=True)
    print("| photos | PSNR without | fitted, without | fitted, with `--exposure` | gain |\n|---|---|---|---|---|")
    for name in "cef":
        folder = walk(camsplat, name, out)
        for kind in ("still", "drift"):
            tests = ["--test", f"{folder}/tests"]
            plain, _ = seeds(2, camsplat, f"{folder}/{kind}", f"{folder}/{kind}-plain", *tests)
            learnt, record = seeds(2, camsplat, f"{folder}/{kind}", f"{folder}/{kind}-learnt", *tests, "--exposure")
            row(f"walk {name}, {kind}", plain, learnt)
            if kind == "drift":
                # Gains of a grey of one half in sRGB, against the true ones, in the mean of the channels and about their mean.
                grey = lambda matrix, offset: np.mean(np.array(matrix).sum(1) + 2 * np.array(offset))
                found = np.array([grey(photo["matrix"], photo["offset"]) for photo in record["exposures"]])
                true = np.array([np.mean(gains(i) ** (1 / 2.2)) for i in range(FRAMES)])
                found, true = np.log2(found / found.mean()), np.log2(true / true.mean())
                error = np.sqrt(np.mean((found - true) ** 2))
                print(f"  learnt gains: rms {error:.3f} of {true.std():.3f} (log2, sRGB), correlation {np.corrcoef(found, true)[0, 1]:.4f}", flush=True)
                json.dump({"found": found.tolist(), "true": true.tolist()}, open(f"{out}/gains-{name}.json", "w"))
    plot(out)
    for capture in captures:
        name = os.path.basename(capture.rstrip("/"))
        plain, _ = seeds(4, camsplat, capture, f"{out}/{name}-plain", "--test-every", 8)
        learnt, _ = seeds(4, camsplat, capture, f"{out}/{name}-learnt", "--test-every", 8, "--exposure")
        row(name, plain, learnt)


if __name__ == "__main__":
    main()
