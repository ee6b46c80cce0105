"""Models of splats through other programs' converters and back, and how much the pictures change.

usage: python research/splat_round_trips.py CAMSPLAT NODE_MODULES OUT MODEL...

CAMSPLAT is the program, NODE_MODULES the folder that `npm install @playcanvas/splat-transform @spz-loader/core` made. For each model
eight cameras are planned around it and rendered. Then, for each format:
ours: we write it, splat-transform makes PLY of it;
theirs: splat-transform writes it, and we read it;
loader (SPZ 3, it does not know 4): we write it, and @spz-loader/core decodes it in Node.
Each result is rendered by us at the same cameras; the table has the PSNR of its pictures against those of the model. glTF is turned by half a
turn about z by splat-transform; its cameras are turned with it.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

LOADER = """
// The package is made for browsers.
process.type = 'renderer';
globalThis.window = globalThis;
const { readFileSync, writeFileSync } = await import('fs');
const { loadSpz } = await import('@spz-loader/core');
const [source, target] = process.argv.slice(2);
const cloud = await loadSpz(new Uint8Array(readFileSync(source)));
const each = [0, 9, 24, 45][cloud.shDegree];
const names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', ...Array.from({ length: each }, (_, k) => `f_rest_${k}`),
    'opacity', 'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
const n = cloud.numPoints, values = new Float32Array(n * names.length);
for (let i = 0, at = 0; i < n; ++i) {
    const put = (array, start, count, of = (v) => v) => { for (let k = 0; k < count; ++k) values[at++] = of(array[start + k]); };
    put(cloud.positions, 3 * i, 3);
    // It hands over colours, opacities and scales, not what they are made of.
    put(cloud.colors, 3 * i, 3, (v) => (v - 0.5) / 0.28209479177387814);
    for (let c = 0; c < 3; ++c) for (let k = 0; k < each / 3; ++k) values[at++] = cloud.sh[each * i + 3 * k + c];
    put(cloud.alphas, i, 1, (v) => Math.log(v / (1 - v)));
    put(cloud.scales, 3 * i, 3, Math.log);
    values[at++] = cloud.rotations[4 * i + 3];
    put(cloud.rotations, 4 * i, 3);
}
const header = `ply\\nformat binary_little_endian 1.0\\nelement vertex ${n}\\n` +
    names.map((name) => `property float ${name}\\n`).join('') + 'end_header\\n';
writeFileSync(target, Buffer.concat([Buffer.from(header), Buffer.from(values.buffer)]));
"""


def run(*command):
    """What a command prints; an error where it fails."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def turned(cameras, out):
    """Cameras turned with a model by half a turn about z."""
    record = json.loads(cameras.read_text())
    for frame in record["frames"]:
        rows = frame["transform_matrix"]
        frame["transform_matrix"] = [[-v for v in rows[0]], [-v for v in rows[1]], rows[2], rows[3]]
    out.write_text(json.dumps(record))
    return out


def main():
    """Makes the table."""
    camsplat, modules, out, *models = [Path(part).resolve() for part in sys.argv[1:]]
    transform = modules / ".bin/splat-transform"
    loader = modules.parent / "load_spz.mjs"
    loader.write_text(LOADER)
    out.mkdir(parents=True, exist_ok=True)
    print("| model | format | MiB, ours | theirs | ours, read by us | by splat-transform | by spz-loader | theirs, read by us |")
    print("|---|---|---|---|---|---|---|---|")
    for model in models:
        folder = out / model.name
        folder.mkdir(exist_ok=True)
        plan = folder / "plan"
        run(camsplat, "plan", model, "--views", 8, "--iterations", 20, "--seed", 1, "--out", plan, "--force")
        cameras = plan / "transforms.json"
        half_turn = turned(cameras, folder / "turned.json")

        def pictures(splats, name, at=cameras):
            target = folder / name
            run(camsplat, "render", splats, at, "--size", "480x480", "--out", target, "--force")
            return target

        whole = pictures(model, "model")

        def psnr(splats, name, at=cameras):
            figures = folder / "metrics.json"
            run(camsplat, "metrics", pictures(splats, name, at), whole, "--lpips", "none", "--json", figures)
            mean = json.loads(figures.read_text())["mean"]["psnr"]
            return math.inf if mean is None else mean

        plain = folder / "plain.ply"
        run(camsplat, "convert", model, plain, "--force")
        for name in ["ply", "compressed.ply", "splat", "spz", "spz4", "sog", "glb"]:
            end = "spz" if name == "spz4" else name
            own = folder / f"ours-{name}.{end}"
            run(camsplat, "convert", model, own, "--force", *(["--format", "spz4"] if name == "spz4" else []))
            figures = [psnr(own, f"own-{name}")]
            back = folder / f"back-{name}.ply"
            if name == "glb":
                # splat-transform writes glTF and does not read it.
                figures.append(None)
            else:
                run(transform, "-w", "-g", "cpu", own, back)
                figures.append(psnr(back, f"back-{name}"))
            if name == "spz":
                decoded = folder / f"decoded-{name}.ply"
                run("node", loader, own, decoded)
                figures.append(psnr(decoded, f"decoded-{name}"))
            else:
                figures.append(None)
            theirs = folder / f"theirs-{name}.{end}"
            if name in ("splat", "spz"):
                figures.append(None)
            else:
                run(transform, "-w", "-g", "cpu", plain, theirs)
                figures.append(psnr(theirs, f"theirs-{name}", half_turn if name == "glb" else cameras))
            sizes = [f"{file.stat().st_size / 2**20:.2f}" if file.exists() else "–" for file in (own, theirs)]
            row = [f"{figure:.1f} dB" if figure is not None else "–" for figure in figures]
            print("|", " | ".join([model.name, f".{name}", *sizes, *row]), "|", flush=True)


main()
