#!/usr/bin/env python3
"""Trains gsplat on a capture as `camsplat train` does, and says how fast and how well. Needs a CUDA device and nvcc.

    pip install torch gsplat==1.5.3 pillow
    pip install git+https://github.com/rahul-goel/fused-ssim --no-build-isolation
    research/gsplat_compare.py nerf-synthetic/lego --iterations 30000 --max-splats 1000000

The capture is a folder of transforms_train.json and transforms_test.json (Blender axes) with RGBA pictures, shown over
white. Strategy, rates, weights and start are those of gsplat's trainer for its MCMC strategy; frame, schedule (compressed
for fewer than 30000 iterations, with no more than five relocations a round of photos; gsplat grows by 5% at each) and random
cube are camsplat's. Where fused-ssim is missing, SSIM is a convolution of
torch, which is slower: the result says so. `--no-ssim` trains on L1 alone: no kernel for SSIM makes gsplat faster than that.
"""

import argparse
import json
import math
import pathlib

import torch
import torch.nn.functional as functional
from gsplat import MCMCStrategy, rasterization
from PIL import Image

try:
    from fused_ssim import fused_ssim
except ImportError:
    fused_ssim = None

DEGREE = 3
CONSTANT = 0.28209479177387814
# Last iterations, in which the budget is spent: the rate is measured over them apart.
TIMED = 1000


def apart(scaled, photos):
    """Iterations between relocations, as src/splats/config.rs has them."""
    return max(scaled(100), 10, min(photos // 5, (scaled(25_000) - scaled(500)) // 20))


def load(folder, name):
    """Pictures over white (N, H, W, 3), camera poses in OpenCV axes (N, 4, 4), and the intrinsics (3, 3) of one split."""
    meta = json.loads((folder / f"transforms_{name}.json").read_text())
    # Blender's cameras look along -Z with Y up.
    flip = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0]))
    pictures, poses = [], []
    for frame in meta["frames"]:
        picture = Image.open((folder / frame["file_path"]).with_suffix(".png")).convert("RGBA")
        values = torch.frombuffer(bytearray(picture.tobytes()), dtype=torch.uint8).float() / 255
        values = values.view(picture.height, picture.width, 4)
        pictures.append(values[..., :3] * values[..., 3:] + 1 - values[..., 3:])
        poses.append(torch.tensor(frame["transform_matrix"]) @ flip)
    height, width = pictures[0].shape[:2]
    focal = 0.5 * width / math.tan(0.5 * meta["camera_angle_x"])
    intrinsics = torch.tensor([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    return torch.stack(pictures).cuda(), torch.stack(poses).cuda(), intrinsics.cuda()


def seen_from(poses, middle, extent):
    """Camera-from-world matrices in the frame whose origin is the cameras' mean and whose unit is their extent."""
    poses = poses.clone()
    poses[:, :3, 3] = (poses[:, :3, 3] - middle) / extent
    return torch.linalg.inv(poses)


def ssim(x, y):
    """Mean SSIM of pictures (1, H, W, 3): Gaussian window of 11 x 11, zeros around the picture."""
    x, y = x.permute(0, 3, 1, 2), y.permute(0, 3, 1, 2)
    if fused_ssim:
        return fused_ssim(x, y, padding="same")
    line = torch.exp(-0.5 * ((torch.arange(11, device=x.device) - 5) / 1.5) ** 2)
    line = line / line.sum()
    planes = torch.cat([x, y, x * x, y * y, x * y], 1)
    count = planes.shape[1]
    planes = functional.conv2d(planes, line.view(1, 1, 1, 11).expand(count, 1, 1, 11), padding=(0, 5), groups=count)
    planes = functional.conv2d(planes, line.view(1, 1, 11, 1).expand(count, 1, 11, 1), padding=(5, 0), groups=count)
    a, b, aa, bb, ab = planes.chunk(5, 1)
    top = (2 * a * b + 1e-4) * (2 * (ab - a * b) + 9e-4)
    return (top / ((a * a + b * b + 1e-4) * (aa - a * a + bb - b * b + 9e-4))).mean()


def start(count, centre, reach, total):
    """`count` random splats in a cube about `centre`, and an optimiser of each parameter: gsplat's for MCMC."""
    means = centre + reach * (2 * torch.rand(count, 3, device="cuda") - 1)
    near = torch.cat([torch.cdist(part, means).topk(4, largest=False).values[:, 1:] for part in means.split(4096)])
    size = (0.1 * near.square().mean(1).sqrt()).clamp_min(1e-7).log()
    colours = (torch.rand(count, 1, 3, device="cuda") - 0.5) / CONSTANT
    values = {
        "means": (means, 1.6e-4),
        "scales": (size[:, None].repeat(1, 3), 5e-3),
        "quats": (torch.rand(count, 4, device="cuda"), 1e-3),
        "opacities": (torch.zeros(count, device="cuda"), 5e-2),
        "sh0": (colours, 2.5e-3),
        "shN": (torch.zeros(count, (DEGREE + 1) ** 2 - 1, 3, device="cuda"), 2.5e-3 / 20),
    }
    splats = torch.nn.ParameterDict({name: torch.nn.Parameter(value) for name, (value, _) in values.items()})
    adam = lambda name: torch.optim.Adam([{"params": splats[name], "lr": values[name][1]}], eps=1e-15, fused=True)
    optimizers = {name: adam(name) for name in values}
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizers["means"], 0.01 ** (1 / total))
    return splats, optimizers, schedule


def render(splats, view, intrinsics, width, height, degree):
    """The picture (1, H, W, 3) over white."""
    colours = torch.cat([splats["sh0"], splats["shN"]], 1)
    pictures, _, info = rasterization(
        splats["means"], splats["quats"], splats["scales"].exp(), splats["opacities"].sigmoid(), colours,
        view[None], intrinsics[None], width, height, sh_degree=degree, packed=False,
        backgrounds=torch.ones(1, 3, device="cuda"),
    )  # fmt: skip
    return pictures, info


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=pathlib.Path)
    parser.add_argument("--iterations", type=int, default=30_000)
    parser.add_argument("--max-splats", type=int, default=1_000_000)
    parser.add_argument("--start", type=int, default=100_000, help="random splats to start with")
    parser.add_argument("--no-ssim", action="store_true", help="train on L1 alone, as a bound on speed")
    arguments = parser.parse_args()
    weight = 0.0 if arguments.no_ssim else 0.2
    torch.manual_seed(0)
    photos, poses, intrinsics = load(arguments.capture, "train")
    height, width = photos.shape[1:3]
    middle = poses[:, :3, 3].mean(0)
    extent = 1.1 * (poses[:, :3, 3] - middle).norm(dim=1).max()
    views = seen_from(poses, middle, extent)
    total, scale = arguments.iterations, min(arguments.iterations / 30_000, 1.0)
    scaled = lambda iterations: max(round(iterations * scale), 1)
    # The synthetic scenes of NeRF lie within 1.3 of the origin.
    count = min(arguments.start, arguments.max_splats)
    splats, optimizers, schedule = start(count, -middle / extent, 1.3 / extent, total)
    strategy = MCMCStrategy(
        cap_max=arguments.max_splats,
        refine_start_iter=scaled(500), refine_stop_iter=scaled(25_000), refine_every=apart(scaled, len(photos)),
    )  # fmt: skip
    strategy.check_sanity(splats, optimizers)
    state = strategy.initialize_state()
    # gsplat may compile its kernels at their first call, which takes minutes.
    render(splats, views[0], intrinsics, width, height, DEGREE)

    marks = {step: torch.cuda.Event(enable_timing=True) for step in [0, max(total - TIMED, 0), total]}
    order = []
    for step in range(total):
        if step in marks:
            marks[step].record()
        order = order or torch.randperm(len(photos)).tolist()
        photo = order.pop()
        degree = min(step // scaled(1000), DEGREE)
        picture, info = render(splats, views[photo], intrinsics, width, height, degree)
        truth = photos[photo][None]
        loss = (1 - weight) * functional.l1_loss(picture, truth)
        if weight:
            loss = loss + weight * (1 - ssim(picture, truth))
        loss = loss + 0.01 * splats["opacities"].sigmoid().mean() + 0.01 * splats["scales"].exp().mean()
        loss.backward()
        for optimizer in optimizers.values():
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        schedule.step()
        strategy.step_post_backward(splats, optimizers, state, step, info, lr=schedule.get_last_lr()[0])
    marks[total].record()
    torch.cuda.synchronize()

    photos, poses, intrinsics = load(arguments.capture, "test")
    with torch.no_grad():
        # Of pictures rounded to 8 bits, as camsplat compares them.
        rounded = lambda picture: (picture.clamp(0, 1) * 255).round() / 255
        errors = []
        for view, photo in zip(seen_from(poses, middle, extent), photos):
            picture = render(splats, view, intrinsics, width, height, DEGREE)[0][0]
            errors.append((rounded(picture) - rounded(photo)).square().mean())
    seconds = marks[0].elapsed_time(marks[total]) * 1e-3
    timed = total - max(total - TIMED, 0)
    last = marks[total - timed].elapsed_time(marks[total]) * 1e-3
    result = {
        "device": torch.cuda.get_device_name(), "splats": len(splats["means"]), "pixels": [width, height],
        "iterations": total, "ssim": not arguments.no_ssim, "fused_ssim": fused_ssim is not None, "seconds": seconds,
        "iterations_per_second": total / seconds, "last_iterations_per_second": timed / last,
        "test_psnr": torch.stack([-10 * error.log10() for error in errors]).mean().item(),
        "peak_bytes": torch.cuda.max_memory_allocated(),
    }  # fmt: skip
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
