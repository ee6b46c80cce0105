#!/usr/bin/env python3
"""Writes the weights of LPIPS v0.1 as `camsplat metrics` reads them (--lpips-vgg, --lpips-alex).

    pip install torch torchvision lpips safetensors
    scripts/make_lpips_weights.py vgg lpips_vgg.safetensors          # f32, 59 MB
    scripts/make_lpips_weights.py vgg lpips_vgg.safetensors --half   # f16, 29 MB

torchvision downloads the network's weights when it is run for the first time; the linear layers come with lpips.
Tensors: conv{i}.weight (out, in, rows, columns), conv{i}.bias (out), lin{i}.weight (channels).
"""

import argparse

import lpips
import torch
from safetensors.torch import save_file


def tensors(model):
    """The tensors of an `lpips.LPIPS` model under the names that camsplat reads."""
    convolutions = [module for module in model.net.modules() if isinstance(module, torch.nn.Conv2d)]
    found = {}
    for i, convolution in enumerate(convolutions):
        found[f"conv{i}.weight"] = convolution.weight
        found[f"conv{i}.bias"] = convolution.bias
    for i, linear in enumerate(model.lins):
        found[f"lin{i}.weight"] = linear.model[-1].weight.flatten()
    return {name: tensor.detach().contiguous() for name, tensor in found.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network", choices=["alex", "vgg"])
    parser.add_argument("file", help="safetensors file to write")
    parser.add_argument("--half", action="store_true", help="round to half precision")
    arguments = parser.parse_args()
    found = tensors(lpips.LPIPS(net=arguments.network, version="0.1", verbose=False))
    if arguments.half:
        found = {name: tensor.half() for name, tensor in found.items()}
    metadata = {"format": "pt", "note": f"LPIPS v0.1 with {arguments.network}"}
    save_file(found, arguments.file, metadata=metadata)


if __name__ == "__main__":
    main()
