"""What the build says of its shaders (shaders.rs, beside the .spv files), and the pipelines that are made of them (pipelines.txt)."""
import os
import pathlib
import re
from dataclasses import dataclass

from translate import traits

TABLE = pathlib.Path(__file__).with_name("pipelines.txt")


@dataclass
class Shader:
    name: str
    path: pathlib.Path
    local_size: int  # threads of a workgroup, where no constant says so
    buffers: int
    push: int  # bytes
    constants: dict  # number by name
    coherent: list  # names of coherent buffers
    capabilities: list  # beside Shader
    subgroups: list  # operations of subgroups

    @property
    def floats(self):
        """Whether floats are added atomically: a stage that the engine makes only where the device can."""
        return "AtomicFloat32AddEXT" in self.capabilities


@dataclass
class Pipeline:
    shader: Shader
    variant: str
    widths: str
    values: dict  # value by name

    @property
    def label(self):
        return self.shader.name if self.variant == "-" else f"{self.shader.name} {self.variant}"

    @property
    def threads(self):
        """Threads of a workgroup: `local_size_x_id` is that of LOCAL_SIZE_X or THREADS."""
        return self.values.get("LOCAL_SIZE_X", self.values.get("THREADS", self.shader.local_size))

    @property
    def plain(self):
        """The label of the pipeline that takes its place where the subgroup size is the driver's choice."""
        return self.label if self.widths == "*" else self.shader.name

    def suits(self, width):
        return self.widths == "*" or width == int(self.widths)

    def line(self):
        """As pipelines.c takes it."""
        special = " ".join(f"{self.shader.constants[name]}={value}" for name, value in self.values.items())
        fields = [self.label, self.shader.path, self.shader.buffers, self.shader.push, self.threads, int(self.shader.floats), special]
        return "\t".join(map(str, fields)) + "\n"


def newest():
    """The folder of the last release build."""
    built = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"), "release/build").glob("camsplat-*/out/shaders.rs")
    return max(built, key=lambda path: path.stat().st_mtime, default=pathlib.Path("none/none")).parent


def shaders(folder):
    """The shaders of a build by name."""
    text = (folder / "shaders.rs").read_text()
    found = {}
    for name, body in re.findall(r"^pub mod (\w+) \{\n    use crate::engine::vulkan::stage.*?\n(.*?)^\}", text, re.M | re.S):
        size = re.search(r"local_size: \[(\d+), (\d+), (\d+)\]", body)
        constants = re.search(r"constants: &\[(.*)\]", body)
        found[name] = Shader(
            name, folder / f"{name}.spv", int(size[1]) * int(size[2]) * int(size[3]),
            len(re.findall(r'^ +\(\d+, "\w+", \w+\),$', body, re.M)),
            int(re.search(r'push: Layout \{ name: "\w*", size: (\d+)', body)[1]),
            {text: int(number) for number, text in re.findall(r'\((\d+), "(\w+)"\)', constants[1])},
            *traits(folder / f"{name}.spv"),
        )
    return found


def pipelines(by_name):
    """Every pipeline: those of the table, and one of each other shader."""
    made = []
    for line in TABLE.read_text().splitlines():
        name, variant, widths, *pairs = line.split("#")[0].split() or [None] * 3
        if name is None:
            continue
        if name not in by_name:
            raise SystemExit(f"portability: {TABLE.name} lists {name}, which is no shader of the build; remove it there")
        values = {key: int(value) for key, value in (pair.split("=") for pair in pairs)}
        unknown = [key for key in values if key not in by_name[name].constants]
        if unknown:
            raise SystemExit(f"portability: {name} has no constant {unknown[0]}; correct {TABLE.name}")
        made.append(Pipeline(by_name[name], variant, widths, values))
    listed = {pipeline.shader.name for pipeline in made}
    made += [Pipeline(shader, "-", "*", {}) for shader in by_name.values() if shader.name not in listed]
    return sorted(made, key=lambda pipeline: pipeline.label)
