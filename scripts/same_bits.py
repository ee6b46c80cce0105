#!/usr/bin/env python3
"""Shows whether a change keeps every bit of what the program computes: runs plans of both objectives, baselines, selections, captures,
trainings and an evaluation, and writes a hash of each result. Needs the data folder (CAMSPLAT_DATA).

    scripts/same_bits.py PROGRAM FOLDER     writes FOLDER/hashes.txt, and everything that it was made from
    diff OLD/hashes.txt NEW/hashes.txt      silent where all bits are the same

Times, versions, names of files and the configuration's own wording do not count.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

# What of plan.json is computed; the rest says what was asked for, by whom and how long it took.
PLAN = ["cameras", "history", "checkpoints", "metrics", "expected", "connection", "tour", "baselines", "region", "limits"]
# In other files: times, and what names things.
SKIPPED = {"stages", "capture", "path", "folder", "seconds", "gpu_seconds", "gpu_ms", "version", "config", "device", "method", "methods", "out", "surface", "elapsed", "command"}
# Neither results nor the same from run to run.
UNREAD = {".html", ".txt", ".svg", ".trace", ".log"}
# Tables have times among their rows; what they hold is in results.json too.
TABLES = {"table.md", "table.csv"}
# Artifacts of an evaluation are named by a hash of what was asked for.
KEY = re.compile(r"-[0-9a-f]{16}\b")

PAPER = "--method paper"
QUICK = "--held-out 100 --seed 3"
CAR, FOX, ROOM = "objects/ToyCar.glb", "photos/fox", "rooms/living-room.glb"
SKY = "hdri/venice_sunset_1k.hdr"


def steps(data):
    """Name and arguments of each command; {OUT} is its folder, {NAME} that of an earlier one."""
    car, fox, room, sky = data / CAR, data / FOX, data / ROOM, data / SKY
    plan = f"plan {car} --out {{OUT}} {QUICK}"
    yield "object", f"{plan} --views 20"
    yield "many", f"{plan} --views 150 --iterations 20"
    yield "keep", f"{plan} --views 8 --keep {{object}}/plan.json"
    yield "connect", f"{plan} --views 10 --connect 25 --iterations 100"
    yield "floor", f"{plan} --views 10 --floor 0 --viewers cone:60,1,0,0"
    yield "dense", f"{plan} --views 12 {PAPER} --iterations 120"
    yield "no-vds", f"{plan} --views 12 --method paper-no-vds --iterations 60 --pass dense"
    yield "binned", f"{plan} --views 40 {PAPER} --pass binned --iterations 60"
    yield "metric", f"{plan} --views 8 {PAPER} --kernel metric --gate pinhole --equal-directions --iterations 40"
    yield "base-loss", f"{plan} --views 8 --method paper-no-vds --no-occlusion --gate hard --iterations 40"
    yield "iterative", f"{plan} --views 4 --method paper-iterative --iterations 50"
    yield "paper-keep", f"{plan} --views 6 {PAPER} --keep {{object}}/plan.json --iterations 60"
    yield "identical", f"{plan} --views 8 {PAPER} --start identical --iterations 60"
    for method in "random fibonacci".split():
        yield f"method-{method}", f"{plan} --views 10 --method {method}"
    for method in "fvs fvs-chord fvs-shared coverage acp".split():
        yield f"method-{method}", f"{plan} --views 10 --method {method} --candidates 400"
    yield "curve", f"plan {car} --out {{OUT}} --seed 3 --curve --iterations 20"
    in_room = f"plan {room} --out {{OUT}} {QUICK} --preset room --views 12"
    yield "room", f"{in_room} --iterations 60"
    yield "room-paper", f"{in_room} --iterations 60 {PAPER}"
    yield "room-grid", f"{in_room} --method grid"
    yield "room-capture", f"capture {room} {{room}}/plan.json --out {{OUT}} --size 48x48 --spp 4 --env {sky}"
    yield "capture", f"capture {car} {{object}}/plan.json --out {{OUT}} --size 96x96 --spp 8 --env {sky}"
    train = "train {capture} --out {OUT} --iterations 150 --max-splats 4000 --seed 2"
    yield "mcmc", train
    yield "adc", f"{train} --strategy adc --sh 1"
    yield "fox", f"plan {fox} --out {{OUT}} {QUICK} --views 6 --iterations 60"
    yield "fox-paper", f"plan {fox} --out {{OUT}} {QUICK} --views 6 --iterations 60 {PAPER}"
    for method in "ours assigned nearest fvs coverage acp fisherrf pop-d pop-t cover".split():
        model = " --model {mcmc}/point_cloud.ply" if method in ("fisherrf", "pop-d", "pop-t", "cover") else ""
        yield f"select-{method}", f"select {{capture}} --count 6 --out {{OUT}} --method {method} --seed 4{model}"
    yield "evaluate", f"evaluate {car} --out {{OUT}} --quick --budgets 6 --seeds 1 --tests 4 --methods random,ours,paper-no-vds,paper-iterative"


def computed(value):
    """A JSON value without what differs from run to run."""
    if isinstance(value, dict):
        return {key: computed(of) for key, of in value.items() if key not in SKIPPED}
    return [computed(of) for of in value] if isinstance(value, list) else value


def content(path):
    """The bytes of a result that are compared; none where it does not count."""
    if path.suffix in UNREAD or path.name in TABLES or path.name.startswith("checkpoint"):
        return None
    if path.name == "plan.json":
        record = json.loads(path.read_text())
        return json.dumps(computed({key: record.get(key) for key in PLAN}), sort_keys=True).encode()
    if path.suffix == ".json":
        return json.dumps(computed(json.loads(path.read_text())), sort_keys=True).encode()
    return path.read_bytes()


def main():
    if len(sys.argv) != 3 or "CAMSPLAT_DATA" not in os.environ:
        sys.exit("usage: CAMSPLAT_DATA=FOLDER scripts/same_bits.py PROGRAM FOLDER")
    program, out, data = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve(), Path(os.environ["CAMSPLAT_DATA"]).resolve()
    out.mkdir(parents=True)
    with open(out / "hashes.txt", "w") as hashes:
        for name, text in steps(data):
            places = {place.name: str(place) for place in out.iterdir() if place.is_dir()}
            arguments = text.format(OUT=out / name, **places).split()
            ran = subprocess.run([program, *arguments], capture_output=True, text=True)
            if ran.returncode != 0:
                print(f"{name}: {ran.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            print(f"{name} exit {ran.returncode}", file=hashes, flush=True)
            found = {path.relative_to(out): content(path) for path in (out / name).rglob("*") if path.is_file()}
            lines = [
                f"{KEY.sub('', str(path))} {hashlib.sha256(bits).hexdigest()[:16]}" for path, bits in found.items() if bits is not None
            ]
            print("\n".join(sorted(lines)), file=hashes, flush=True)


main()
