"""Checks the shaders of a build for devices that are not here, and prints what was found as Markdown; see portability.sh."""
import os
import pathlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import drivers
import shaders
import tables
import translate

USAGE = "usage: scripts/portability.sh [--all] [FOLDER with .spv files and shaders.rs]; build the release first"
METAL = """\
Coherent buffers (above) become `volatile`, which promises nothing between threadgroups before MSL 3.2: a workgroup reads there only what it
wrote itself, behind barriers. Between workgroups words are atomic (shared/across.glsl). Constants that are macros need
MoltenVK 1.3.0, which compiles the text anew for each of their values. Functions that begin with spv are the translator's: spvFAdd, spvFMul
and spvFSub keep `precise` arithmetic from being contracted.
"""
LEGEND = """
A column is a GPU with the subgroup size that the driver chooses (default) or that is required. `shared` is in bytes. A cell has VGPRs/SGPRs
(AMD), instructions, and behind + bytes of scratch memory a thread, with ! where registers are spilled to it.

"""
WIDTHS = """\
Estimated cost with a required size over that with the driver's choice, where it differs by more than 5%: for AMD cycles for 64 threads, for
Intel those of a workgroup. `shuffles` and `eight` are compared with the exchange through shared memory.
"""
BUDGETS = "radix_sweep is for NVIDIA's GPUs alone, which have 48 KiB of shared memory.\n"


def section(title, *texts):
    print(f"\n## {title}\n\n" + "\n".join(texts), flush=True)


def validate(found):
    """Prints what modules ask for; returns those that are valid, and failures."""
    said = {name: translate.invalid(shader.path) for name, shader in found.items()}
    valid = {name: shader for name, shader in found.items() if not said[name]}
    tool = subprocess.run(["spirv-val", "--version"], capture_output=True, text=True).stdout.split()[:2]
    section("SPIR-V", f"Valid for Vulkan 1.2: {len(valid)} of {len(found)} ({' '.join(tool)}).\n", tables.traits(valid.values()))
    return valid, [f"{name}: {line}" for name, lines in said.items() for line in lines]


def to_metal(found):
    """Prints what becomes of modules in Metal; returns failures. MSL adds floats atomically from 3.0 on."""
    optional = [name for name, shader in found.items() if shader.floats]
    made = {name: translate.to_metal(shader.path, shader.constants) for name, shader in found.items() if name not in optional}
    count = sum(not one.refused for one in made.values())
    version = f"{translate.METAL[0]}.{int(translate.METAL[1:3])}"
    section("Metal", f"Translated to MSL {version}: {count} of {len(made)}; skipped, since it adds floats atomically: {tables.listed(optional)}.",
            METAL, tables.metal(made))
    return [f"{name}: Metal: {line}" for name, one in made.items() for line in one.refused]


def compile_on(gpus, pipelines):
    """Runs of each GPU with each subgroup size, side by side; in order."""
    work = [(gpu, width) for gpu in gpus for width in gpu.widths]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(zip(work, pool.map(lambda one: drivers.compile_all(*one, pipelines), work)))


def report(title, pipelines, runs):
    """Prints what drivers say of pipelines; returns failures."""
    text = "".join(sorted({f"* {gpu.name}: {run.device}\n" for (gpu, _), run in runs if run.device}))
    failures = []
    for (gpu, width), run in runs:
        head = f"{gpu.name}, {width or 'default'}"
        failures += [f"{head}: {label}: {why}" for label, why in run.failures.items()]
        if run.skipped:
            text += f"* skipped: {head}: {run.skipped}\n"
            # The driver for AMD's GPUs needs nothing but its package.
            failures += [f"{head}: {run.skipped}"] * (gpu in drivers.AMD)
        else:
            text += f"* {head}: {len(run.compiled)} pipelines\n"
    measured = any(one.values for _, run in runs for one in run.compiled.values())
    section(title, text + (LEGEND + tables.compiled(pipelines, runs) if measured else ""))
    return failures


def main(arguments):
    intel = drivers.INTEL + [drivers.ARC] * ("--all" in arguments)
    folders = [argument for argument in arguments if argument != "--all"]
    folder = pathlib.Path(folders[0]) if folders else shaders.newest()
    if len(folders) > 1 or not (folder / "shaders.rs").exists():
        sys.exit(USAGE)
    found = shaders.shaders(folder)
    print(f"# Portability of the shaders\n\n{len(found)} shaders, {len(shaders.pipelines(found))} pipelines of them.")
    valid, failures = validate(found)
    failures += to_metal(valid)
    pipelines = [pipeline for pipeline in shaders.pipelines(found) if pipeline.shader.name in valid]
    # The slowest first.
    runs = compile_on(intel + drivers.AMD + drivers.CPU, pipelines)
    of = {name: [(one, run) for one, run in runs if one[0] in gpus] for name, gpus in
          [("AMD", drivers.AMD), ("Intel", intel), ("Other drivers", drivers.CPU)]}
    for title, own in of.items():
        failures += report(title, pipelines, own)
    print("* skipped: NVK: Mesa's driver for NVIDIA's GPUs opens no device without the kernel's")
    section("Required subgroup sizes", WIDTHS, tables.widths(pipelines, of["AMD"] + of["Intel"]))
    section("Budgets", BUDGETS, tables.budgets(pipelines, of["AMD"] + of["Intel"]))
    section("Failures", "\n".join(f"* {line}" for line in failures) or "None.")
    for line in failures:
        print(f"portability.sh: {line}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
