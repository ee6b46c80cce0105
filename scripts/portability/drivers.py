"""Pipelines compiled by drivers of Mesa for GPUs that are not there."""
import os
import pathlib
import subprocess
from dataclasses import dataclass, field

TOOLS = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"), "portability")
ICDS = [pathlib.Path(folder) for folder in ("/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d")]


@dataclass
class Gpu:
    name: str
    icd: str
    widths: list  # required subgroup sizes; 0 for the driver's choice
    environment: dict
    # The same GPU's environment under the name that other versions of the driver have for it.
    otherwise: dict = field(default_factory=dict)


def intel(device):
    return {"INTEL_DEVICE": device, "INTEL_NO_HW": "1", "LD_PRELOAD": str((TOOLS / "intel_device.so").resolve())}


AMD = [
    Gpu("navi21", "radeon", [0, 32], {"RADV_FORCE_FAMILY": "navi21"}),
    Gpu("navi31", "radeon", [0, 32], {"RADV_FORCE_FAMILY": "navi31"}, {"RADV_FORCE_FAMILY": "gfx1100"}),
    Gpu("vega10", "radeon", [0], {"RADV_FORCE_FAMILY": "vega10"}),
]
INTEL = [Gpu("Xe (TGL)", "intel", [0, 8, 32], intel("0x9a49"))]
# The driver takes minutes over it.
ARC = Gpu("Arc (DG2)", "intel", [0, 8, 32], intel("0x56a0"))
CPU = [Gpu("lavapipe", "lvp", [0, 8], {})]


@dataclass
class Compiled:
    """What a driver says of a pipeline."""

    width: int
    values: dict

    def get(self, *names):
        return next((self.values[name] for name in names if name in self.values), 0)

    @property
    def scratch(self):
        return self.get("Scratch size", "Scratch Memory Size")

    @property
    def spilled(self):
        return self.get("Spilled VGPRs", "Spill Count")

    @property
    def shared(self):
        return self.get("LDS size", "Workgroup Memory Size")

    @property
    def instructions(self):
        return self.get("Instructions", "Instrs", "Instruction Count")

    def cost(self, threads):
        """The driver's estimate of cycles for 64 threads, or for a workgroup."""
        if "Cycle Count" in self.values:
            return self.values["Cycle Count"] * -(-threads // self.width)
        return self.values.get("Inverse Throughput", 0)


@dataclass
class Run:
    """What came of a GPU with a required subgroup size."""

    skipped: str = ""
    device: str = ""
    compiled: dict = field(default_factory=dict)  # by label
    failures: dict = field(default_factory=dict)  # reason by label


def manifest(icd):
    return next((path for folder in ICDS for path in sorted(folder.glob(f"{icd}_icd*.json"))), None)


def compile_all(gpu, width, pipelines):
    path = manifest(gpu.icd)
    if path is None:
        return Run(skipped=f"no driver {gpu.icd}_icd; install mesa-vulkan-drivers")
    if "LD_PRELOAD" in gpu.environment and not os.path.exists(gpu.environment["LD_PRELOAD"]):
        return Run(skipped="intel_device.c was not compiled; install libdrm-dev")
    chosen = [pipeline for pipeline in pipelines if pipeline.suits(width)]
    if gpu.icd == "intel" and width:
        # Its compiler is slow, and spills much in wide subgroups: only those that may profit.
        chosen = [pipeline for pipeline in chosen if pipeline.shader.subgroups]
    run = attempt(path, gpu.environment, width, chosen)
    return attempt(path, gpu.otherwise, width, chosen) if run.skipped and gpu.otherwise else run


def attempt(path, environment, width, pipelines):
    names = {"VK_DRIVER_FILES": str(path), "VK_ICD_FILENAMES": str(path), "MESA_SHADER_CACHE_DISABLE": "true", "VK_LOADER_LAYERS_DISABLE": "~all~"}
    done = subprocess.run(
        [TOOLS / "pipelines", str(width)], input="".join(pipeline.line() for pipeline in pipelines), capture_output=True, text=True,
        env={**os.environ, **names, **environment},
    )
    lines = done.stdout.splitlines()
    if done.returncode == 3 or not lines:
        return Run(skipped=lines[-1] if lines else (done.stderr.strip().splitlines() or [f"ends with {done.returncode}"])[-1])
    device = lines[0].split("\t")
    run = Run(device=f"{device[0]}; {device[1]}; subgroups of {device[2].replace('-', ' to ')}")
    for line in lines[1:]:
        label, *fields = line.split("\t")
        if fields[:1] != ["ok"]:
            run.failures[label] = fields[0] if fields else f"the driver crashed ({done.returncode})"
        elif len(fields) > 1:
            values = dict(pair.rsplit("=", 1) for pair in fields[2:] if "=" in pair)
            run.compiled[label] = Compiled(int(fields[1]), {name: int(value) for name, value in values.items()})
        else:
            run.compiled[label] = Compiled(0, {})
    if done.returncode < 0 and len(lines) > 1:
        # The driver crashed at the last of them: go on behind it.
        labels = [pipeline.label for pipeline in pipelines]
        rest = attempt(path, environment, width, pipelines[labels.index(lines[-1].split("\t")[0]) + 1:])
        run.compiled |= rest.compiled
        run.failures |= rest.failures
    return run
