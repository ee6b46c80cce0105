"""The findings as Markdown."""

SHARED = 32 << 10  # bytes that every device with Vulkan has, as the engine asks for
VGPRS = 128  # from here on a SIMD of RDNA 2 holds at most 8 subgroups of 64 threads


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


def listed(names):
    return ", ".join(names) or "none"


def traits(shaders):
    rows = [(s.name, listed(s.coherent), listed(s.subgroups)) for s in shaders if s.coherent or s.subgroups]
    return table(["shader", "coherent buffers", "subgroup operations"], rows)


def metal(translations):
    rows = [
        (name, listed(t.refused), listed(t.emulated), listed(t.macros))
        for name, t in translations.items() if t.refused or t.emulated or t.macros
    ]
    return table(["shader", "refused", "emulated", "constants that are macros"], rows)


def cell(compiled):
    """Registers, instructions and scratch of a pipeline."""
    if compiled is None:
        return ""
    registers = [str(compiled.values[name]) for name in ("VGPRs", "Pre-Sched SGPRs") if name in compiled.values]
    text = " ".join(filter(None, ["/".join(registers), str(compiled.instructions)]))
    if compiled.scratch:
        text += f" +{compiled.scratch // compiled.width}" + ("!" if compiled.spilled else "")
    return text


def columns(runs):
    """Head and runs of the columns: a GPU with its driver's choice, or with a required size."""
    return [(f"{gpu.name}, {width or 'default'}", run) for (gpu, width), run in runs if run.compiled]


def compiled(pipelines, runs):
    shown = columns(runs)
    rows = []
    for pipeline in pipelines:
        found = [run.compiled.get(pipeline.label) for _, run in shown]
        if any(found):
            shared = max(one.shared for one in found if one)
            rows.append([pipeline.label, pipeline.threads, shared or "", *map(cell, found)])
    return table(["pipeline", "threads", "shared", *(head for head, _ in shown)], rows)


def budgets(pipelines, runs):
    """What goes beyond: a line for each budget and column."""
    rows = []
    for head, run in columns(runs):
        found = {pipeline.label: run.compiled[pipeline.label] for pipeline in pipelines if pipeline.label in run.compiled}
        spilled = [f"{label} ({one.spilled})" for label, one in found.items() if one.spilled]
        shared = [f"{label} ({one.shared})" for label, one in found.items() if one.shared > SHARED]
        many = [f"{label} ({one.values['VGPRs']})" for label, one in found.items() if one.values.get("VGPRs", 0) > VGPRS]
        rows.append((head, listed(spilled), listed(shared), listed(many)))
    return table(["GPU", "spills (registers)", f"more than {SHARED >> 10} KiB shared", f"more than {VGPRS} VGPRs"], rows)


def widths(pipelines, runs):
    """Estimated cost with a required subgroup size over that with the driver's choice, pipeline by pipeline."""
    chosen = {gpu.name: run.compiled for (gpu, width), run in runs if width == 0}
    shown = [(f"{gpu.name}, {width}", run.compiled, chosen[gpu.name]) for (gpu, width), run in runs if width and run.compiled]
    threads = {pipeline.label: pipeline.threads for pipeline in pipelines}
    rows = []
    for pipeline in pipelines:
        ratios = []
        for _, required, free in shown:
            one, other = required.get(pipeline.label), free.get(pipeline.plain)
            cost = other.cost(threads[pipeline.plain]) if other else 0
            ratios.append(one.cost(pipeline.threads) / cost if one and cost else None)
        if any(ratio and abs(ratio - 1) > 0.05 for ratio in ratios):
            rows.append([pipeline.label, pipeline.threads, *(f"{ratio:.2f}" if ratio else "" for ratio in ratios)])
    return table(["pipeline", "threads", *(head for head, _, _ in shown)], rows)
