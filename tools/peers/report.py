"""The page that peers.py writes."""

import math
import os
import platform
import statistics
import subprocess
import sys
from pathlib import Path

NAMES = {
    "yarnray": "yarnray `--mode fiber`",
    "mitsuba llvm": "Mitsuba 3 `llvm_ad_rgb`",
    "mitsuba scalar": "Mitsuba 3 `scalar_rgb`",
    "cycles": "Cycles",
}


def machine():
    cpu = next(l.split(":")[1].strip() for l in Path("/proc/cpuinfo").read_text().splitlines() if l.startswith("model name"))
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return f"{cpu}, {os.cpu_count()} threads, {memory:.0f} GB, {platform.system().lower()} {platform.machine()}"


def versions(options):
    """What was measured."""
    asked = {"": [options.yarnray, "--version"], "Mitsuba ": [sys.executable, "-c", "import mitsuba; print(mitsuba.__version__)"]}
    if options.cycles:
        asked["Cycles of Blender "] = [options.cycles, "-c", "import bpy; print(bpy.app.version_string)"]
    answers = (
        name + subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]
        for name, command in asked.items()
    )
    return ", ".join(answers)


def with_spread(values):
    """Mean and standard error."""
    if len(values) == 1:
        return f"{values[0]:.3g}"
    return f"{statistics.mean(values):.3g} ± {statistics.stdev(values) / math.sqrt(len(values)):.2g}"


def cost(run):
    """What stays the same however many samples a run takes."""
    return run["error"] * run["render"]


def ratios(runs, ours, measure):
    """Of these runs over ours, round by round."""
    return [measure(r) / measure(o) for r, o in zip(runs, ours)]


def mean(runs, key):
    return statistics.mean(run[key] for run in runs)


def cost_table(options, cases):
    samples = options.size[0] * options.size[1] * options.spp
    lines = [
        "| case | threads | renderer | relMSE | render, s | relMSE x s | **over yarnray** | samples/s | build, s | all, s | process, MB (imports) |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for (scene, light), (found, _) in cases.items():
        for (threads, renderer), runs in found.items():
            over = with_spread(ratios(runs, found[threads, "yarnray"], cost)) if renderer != "yarnray" else "1"
            lines.append(
                f"| {scene}, {light} | {threads} | {NAMES[renderer]} | {mean(runs, 'error'):.4f} | {mean(runs, 'render'):.2f} | "
                f"{statistics.mean(map(cost, runs)):.4f} | {over} | {samples / mean(runs, 'render') / 1e6:.3f} M | {mean(runs, 'build'):.2f} | {mean(runs, 'total'):.2f} | "
                f"{mean(runs, 'memory') / 1e6:.0f} ({mean(runs, 'imported') / 1e6:.0f}) |"
            )
    return "\n".join(lines)


def summary(cases):
    """Geometric means over all cases, and the least and most of the means of single cases."""
    lines = [
        "| time over yarnray's | threads | to equal error | least to most | for equal samples | least to most |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    kinds = [kind for kind in next(iter(cases.values()))[0] if kind[1] != "yarnray"]
    for threads, renderer in sorted(kinds, key=lambda kind: kind[1]):
        cells = []
        for measure in (cost, lambda run: run["render"]):
            values = [
                statistics.mean(ratios(found[threads, renderer], found[threads, "yarnray"], measure))
                for found, _ in cases.values()
            ]
            middle = statistics.geometric_mean(values)
            cells += [f"{middle:.2f}", f"{min(values):.2f} to {max(values):.2f}"]
        lines.append(f"| {NAMES[renderer]} | {threads} | {' | '.join(cells)} |")
    return "\n".join(lines)


def means_table(cases):
    lines = ["| case | " + " | ".join(NAMES[r].split(" `")[0] for r in next(iter(cases.values()))[1]) + " |"]
    lines.append("| --- |" + " --- |" * (lines[0].count("|") - 2))
    for (scene, light), (_, pictures) in cases.items():
        cells = [" ".join(f"{x:.4f}" for x in picture.mean(axis=(0, 1))) for picture in pictures.values()]
        lines.append(f"| {scene}, {light} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def lists(values):
    return ", ".join(f"{v:g}" for v in values)


def markdown(options, cases, fiber, lobes):
    width, height = options.size
    bounces = ", ".join(
        f"{scene} {light} {mean(found[threads, 'yarnray'], 'bounces'):.1f}"
        for (scene, light), (found, _) in cases.items()
        for threads in [next(iter(found))[0]]
    )
    return f"""# Explicit fibres: yarnray, Mitsuba 3 and Cycles

What a path through explicit fibres costs, per unit of error, in the reference mode `--mode fiber` and in two renderers in wide
use. `tools/peers/peers.py` measures and writes this page; `tools/peers/README.md` says how to install what it needs.

Machine: {machine()}. Programs: {versions(options)}. {options.note}

{summary(cases)}

More than 1 means that yarnray is faster. "To equal error" is (relMSE x seconds of rendering) over yarnray's in the same round, which
stays the same however many samples a run takes; "for equal samples" is the time alone, which says how fast paths are traced.
The two differ by noise, and noise in part by the model of the fibre: the peers' is a dielectric seen at an offset, whose lobes are sharper from
one place to the next than yarnray's, which are averaged over the width. How large that part is has not been measured; "for
equal samples" is nearly free of it.

## What is equal
- The fibres: `yarnray make fibers` of `scenes/table3/silk.toml` and `knit.toml`. Mitsuba reads that file (`bsplinecurve`); Cycles, whose
  curves are Catmull-Rom, gets the places of the same knots, as round curves (`THICK`). All three trace them with Embree.
- The camera, a box filter of one pixel, {width} x {height} pixels, {options.spp} samples per pixel; linear RGB in single precision, no other layers.
- One distant light without extent, from the front or the back, or an even white sky.
- Up to {options.bounces} scattering events; Russian roulette after the fourth. No denoiser, adaptive sampling, clamping or path guiding.
- Between Mitsuba and Cycles the fibre itself: Chiang et al. 2016, index {fiber.ior}, absorption {lists(fiber.sigma)}, roughness
  {fiber.longitudinal} along and {fiber.azimuthal} around, scales without tilt.

## What is not
- yarnray's fibre has R, TT and D, averaged over its width, not a dielectric seen at an offset. Its albedos are those of the dielectric,
  averaged over width and directions (R {lists(lobes.r[:1])}; TT {lists(lobes.tt)}; D for the rest {lists(lobes.d)}), its widths the
  same standard deviations ({lobes.beta_r:.1f}, {lobes.beta_tt:.1f} and {lobes.beta_n:.1f} degrees). Pictures thus differ a little (see the
  means), and so does their noise.
- Under the even sky yarnray lets paths find the light; the peers also send shadow rays.
- The probability of survival in Russian roulette: the largest channel of the throughput, at least 0.05 (yarnray), at most 0.95 (Mitsuba), its
  square root (Cycles).
- Sampling patterns are each renderer's own: Mitsuba's `independent`, Cycles' `TABULATED_SOBOL`. Cycles keeps its light tree and its
  threshold for small light.
- Mitsuba's LLVM variant traces a whole picture at once in vectors. The first render in each process, which compiles kernels (Mitsuba) or
  builds the BVH (Cycles), counts as build. Cycles' render has the start of a render in it, some hundredths of a second.
- "All" is the whole process from start to end, with what Python, imports and reading fibres take. Peak memory is that of the process; in brackets what Python and the imported module take before there is a scene.

Errors are relMSE against each renderer's own converged picture ({options.converged} samples per pixel, independent seeds; its own noise
subtracted): mean over pixels and channels of (picture - converged)^2 / (converged^2 + 0.01). {options.repeats} rounds, each run a
process of its own, renderers by turns; ± is the standard error over rounds.

## Mean radiance of the converged pictures, R G B
{means_table(cases)}

Mean number of scattering events of yarnray's paths: {bounces}.

## All figures
{cost_table(options, cases)}
"""
