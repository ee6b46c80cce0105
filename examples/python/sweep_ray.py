r"""Plans and evaluations over a Ray cluster, with the results as one table.

    python examples/python/sweep_ray.py plans chair.glb helmet.glb --views 20,50 --seeds 3 --out plans
    python examples/python/sweep_ray.py evaluation helmet.glb --shards 8 --out results \
        --options '{"env": "/shared/studio.hdr", "methods": "random,fvs,ours", "budgets": 50}'

`plans` places cameras for every scene, number of views and seed, and writes OUT/plans.csv beside the plans' folders. `evaluation` divides
the runs of `camsplat evaluate` into shards, makes each in a task of its own and writes the tables of all of them. Paths are on a file
system that all machines share, and for `evaluation` one that can lock files. Options are those of
`camsplat plan` or `camsplat evaluate`, as JSON with underscores; paths in them are absolute.

A task that dies is tried again, on another machine where there is one. It goes on from what it had finished, and so does a second call of
the same command: give another --out for other options. A task takes a GPU, or a CPU core with --cpu. Needs
`pip install camsplat "ray[default]"`; RAY_ADDRESS names the cluster, else one is started on this machine.
"""

import argparse
import csv
import itertools
import json
from pathlib import Path

import ray

import camsplat

RETRIES = 3


def device() -> dict:
    """The Vulkan device of this task, as an option: that with the number which Ray gave it, on machines with GPUs of one kind."""
    gpus = ray.get_gpu_ids()
    return {"device": int(gpus[0])} if gpus else {}


@ray.remote(max_retries=RETRIES)
def make_plan(scene: str, views: int, seed: int, out: str, options: dict) -> dict:
    """Plans into the folder `out`, unless an earlier call has, and returns a row of the table."""
    folder = Path(out)
    asked = {"scene": scene, "views": views, "seed": seed, "options": options}
    request = folder.with_name(f"{folder.name}.request.json")
    # plan.json comes with the whole folder.
    if (folder / "plan.json").exists():
        if not request.exists() or json.loads(request.read_text()) != asked:
            raise camsplat.Error(f"{folder}: a plan of another request is here; give another --out")
        plan = camsplat.Plan(folder)
    else:
        request.write_text(json.dumps(asked))
        plan = camsplat.plan(scene, views=views, seed=seed, out=folder, **{**device(), **options})
    return {"scene": scene, "views": views, "seed": seed, "expected_db": plan.expected, "folder": out}


@ray.remote(max_retries=RETRIES)
def make_shard(scenes: list, out: str, shard: str, options: dict) -> str:
    """Makes a shard of an evaluation."""
    camsplat.command("evaluate", *scenes, out=out, shard=shard, **{**device(), **options})
    return shard


def plans(arguments: argparse.Namespace, resources: dict) -> None:
    names = [Path(scene).stem for scene in arguments.scenes]
    if len(set(names)) < len(names) or not names:
        raise SystemExit("scenes: give some, each with a file name of its own, since plans are in folders of that name")
    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    views = [int(number) for number in arguments.views.split(",")]
    task = make_plan.options(**resources)
    waiting = [
        task.remote(scene, count, seed, str(out / f"{Path(scene).stem}-{count}-{seed}"), arguments.options)
        for scene, count, seed in itertools.product(arguments.scenes, views, range(arguments.seeds))
    ]
    rows = ray.get(waiting)
    with open(out / "plans.csv", "w", newline="") as file:
        table = csv.DictWriter(file, rows[0].keys())
        table.writeheader()
        table.writerows(rows)
    print(f"{len(rows)} plans: {out / 'plans.csv'}")


def evaluation(arguments: argparse.Namespace, resources: dict) -> None:
    task = make_shard.options(**resources)
    count = arguments.shards
    waiting = [task.remote(arguments.scenes, arguments.out, f"{i}/{count}", arguments.options) for i in range(1, count + 1)]
    while waiting:
        done, waiting = ray.wait(waiting)
        print(f"shard {ray.get(done[0])} is complete")
    # All results are there: this makes nothing but the tables.
    whole = camsplat.evaluate(arguments.scenes, arguments.out, **arguments.options)
    print(f"{len(whole.rows)} rows: {whole.folder / 'table.csv'}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for work, help_line in [(plans, "plan for scenes"), (evaluation, "compare methods")]:
        command = commands.add_parser(work.__name__, help=help_line)
        command.add_argument("scenes", nargs="*", type=lambda path: str(Path(path).resolve()))
        command.add_argument("--out", required=True, type=lambda path: str(Path(path).resolve()))
        command.add_argument("--options", type=json.loads, default={}, help="further options, as JSON")
        command.add_argument("--cpu", action="store_true", help="a CPU core for each task in place of a GPU")
        command.set_defaults(work=work)
        if work is plans:
            command.add_argument("--views", default="50")
            command.add_argument("--seeds", type=int, default=1)
        else:
            command.add_argument("--shards", type=int, required=True)
    arguments = parser.parse_args()
    ray.init(log_to_driver=False)
    arguments.work(arguments, {"num_cpus": 1, "num_gpus": 0 if arguments.cpu else 1})


if __name__ == "__main__":
    main()
