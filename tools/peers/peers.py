#!/usr/bin/env python3
"""Holds yarnray's explicit fibres against Mitsuba 3 and Cycles: the same fibres, camera, light and depth of paths.

    python tools/peers/peers.py --cycles PYTHON -o docs/peers.md

README.md beside this file says how to install both. This program runs in Mitsuba's Python; `--cycles` names that of bpy.
Each run is a process of its own; runs of all renderers take turns. What is done is kept in `--work`: an interrupted
measurement goes on where it was. No renderer's error depends on what another computes: each is held against its own
converged picture.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import mitsuba as mi
import numpy as np

import report
from fiber import SILK, equivalent

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent

# Distance of the camera in millimetres, so that the cloth fills the picture.
SCENES = {"silk": 20.0, "knit": 80.0}
VIEW = np.array([0.1, 0.1, 1.0]) / np.linalg.norm([0.1, 0.1, 1.0])
FOV = 20.0
LIGHTS = {
    "front": {"towards": [0.35, 0.36, 0.866], "irradiance": 3.14159},
    "back": {"towards": [0.35, 0.36, -0.866], "irradiance": 3.14159},
    "sky": "sky",
}
RENDERERS = ["yarnray", "mitsuba llvm", "mitsuba scalar", "cycles"]
ROULETTE_AFTER = 4  # scattering events that every path may have; yarnray's own figure


def converged_by(renderer):
    """Which renderer's converged picture is held against: Mitsuba's variants have one between them."""
    return "mitsuba llvm" if renderer.startswith("mitsuba") else renderer


class Bench:
    """Runs jobs, and keeps what they give in a folder."""

    def __init__(self, options):
        self.options = options
        self.work = options.work
        self.work.mkdir(parents=True, exist_ok=True)

    def fibers(self, scene):
        """The scene's fibres as Mitsuba reads them."""
        path = self.work / f"{scene}.txt"
        if not path.exists():
            run([self.options.yarnray, "make", "fibers", ROOT / f"scenes/table3/{scene}.toml", "--quiet", "-o", path])
        return path

    def render(self, name, renderer, scene, light, **settings):
        """The picture, and times in seconds and memory in bytes, of one run: of the folder if it is there."""
        picture, record = self.work / f"{name}.npy", self.work / f"{name}.json"
        if not record.exists():
            job = {
                "picture": str(picture),
                "curves": str(self.fibers(scene)),
                "fiber": asdict(SILK),
                "camera": {"position": [float(x) for x in SCENES[scene] * VIEW], "target": [0, 0, 0], "fov": FOV},
                "light": LIGHTS[light],
                "size": self.options.size,
                "bounces": self.options.bounces,
                "roulette_after": ROULETTE_AFTER,
                "passes": 1,
                **settings,
            }
            print(f"{name} ...", end=" ", file=sys.stderr, flush=True)
            started = time.perf_counter()
            found = self.yarnray(job, scene) if renderer == "yarnray" else self.worker(job, renderer)
            found["total"] = time.perf_counter() - started
            print(f"{found['render']:.2f} s", file=sys.stderr)
            record.write_text(json.dumps(found))
        return np.load(picture), json.loads(record.read_text())

    def worker(self, job, renderer):
        path = self.work / "job.json"
        if renderer == "cycles":
            command = [self.options.cycles, HERE / "cycles_worker.py", path]
        else:
            job["variant"] = {"mitsuba llvm": "llvm_ad_rgb", "mitsuba scalar": "scalar_rgb"}[renderer]
            command = [sys.executable, HERE / "mitsuba_worker.py", path]
        path.write_text(json.dumps(job))
        return json.loads(run(command))

    def yarnray(self, job, scene):
        stats, picture = self.work / "stats.json", self.work / "picture.exr"
        camera, light = job["camera"], job["light"]
        if light == "sky":
            lit = '{type = "environment", radiance = 1}'
        else:
            lit = f'{{type = "distant", towards = {light["towards"]}, irradiance = {light["irradiance"]}}}'
        view = f'{{type = "perspective", position = {camera["position"]}, target = {camera["target"]}, fov = {FOV}}}'
        keys = {
            "camera": view,
            "light": f"[{lit}]",
            "fiber.silk": equivalent(SILK).toml(),
            "render.filter": '"box"',
            "output.layers": "[]",
        }
        total = []
        render = 0.0
        for i in range(job["passes"]):
            command = [self.options.yarnray, "render", ROOT / f"scenes/table3/{scene}.toml", "--quiet", "--mode", "fiber"]
            numbers = {"spp": job["spp"], "seed": job["seed"] + i, "threads": job["threads"], "max-bounces": job["bounces"]}
            numbers |= {"width": job["size"][0], "height": job["size"][1]}
            command += [word for key, value in numbers.items() for word in (f"--{key}", value)]
            command += [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
            run([*command, "--stats", stats, "-o", picture])
            run_stats = json.loads(stats.read_text())
            render += run_stats["seconds"]["render"]
            rgb = mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
            total.append(np.array(rgb))
        np.save(job["picture"], np.mean(total, axis=0))
        seconds = run_stats["seconds"]
        return {
            "build": seconds["load"] + seconds["generate"] + seconds["build"],
            "render": render,
            "memory": run_stats["memory"]["peak_rss_bytes"],
            "imported": 0,
            "rays": sum(run_stats["rays"].values()),
            "bounces": run_stats["mean_bounces"],
        }

    def converged(self, renderer, scene, light):
        """The mean of two pictures of independent seeds, and that mean's own relMSE as their difference tells it."""
        halves = []
        for half in range(2):
            name = f"{scene} {light} {renderer} converged {half}"
            settings = {"spp": 64, "passes": self.options.converged // 128, "seed": 10_000 * (half + 1)}
            halves.append(self.render(name, renderer, scene, light, threads=os.cpu_count(), **settings)[0])
        mean = (halves[0] + halves[1]) / 2
        return mean, rel_mse(halves[0], mean)

    def measure(self, scene, light):
        """All runs of one case: for each number of threads and renderer what its runs gave, in order."""
        wanted = {converged_by(r) for r in self.options.renderers}
        truth = {r: self.converged(r, scene, light) for r in RENDERERS if r in wanted}
        found = {}
        for repeat in range(self.options.repeats):
            for threads in self.options.threads:
                for renderer in self.options.renderers:
                    name = f"{scene} {light} {renderer} {threads} {repeat}"
                    seed = 1 + repeat
                    picture, record = self.render(
                        name, renderer, scene, light, threads=threads, spp=self.options.spp, seed=seed
                    )
                    mean, noise = truth[converged_by(renderer)]
                    record["error"] = rel_mse(picture, mean) - noise
                    found.setdefault((threads, renderer), []).append(record)
        return found, {renderer: mean for renderer, (mean, _) in truth.items()}


def rel_mse(picture, reference):
    """As `yarnray compare` has it."""
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 0.01)))


def run(command):
    """Standard output of a command; what it says on standard error is shown if it fails."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{done.stderr[-3000:]}")
    return done.stdout


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--yarnray", type=Path, default=ROOT / "target/release/yarnray")
    parser.add_argument("--cycles", type=Path, help="the Python that has bpy; without it Cycles is left out")
    parser.add_argument("--work", type=Path, default=ROOT / "out/peers", help="what is kept from run to run")
    parser.add_argument("-o", "--out", type=Path, help="the table (.md); standard output without")
    parser.add_argument("--picture", type=Path, help="the converged pictures side by side (.png)")
    parser.add_argument("--cases", nargs="+", default=[f"{s}:{l}" for s in SCENES for l in LIGHTS], metavar="SCENE:LIGHT")
    parser.add_argument("--size", type=int, nargs=2, default=[128, 96])
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--bounces", type=int, default=200, help="most scattering events of a path")
    parser.add_argument("--converged", type=int, default=512, help="samples of converged pictures, a multiple of 128")
    parser.add_argument("--threads", type=int, nargs="+", default=sorted({1, os.cpu_count()}))
    parser.add_argument("--note", default="The machine was idle.", help="what is said of the machine's load")
    options = parser.parse_args()
    options.renderers = [r for r in RENDERERS if r != "cycles" or options.cycles]
    return options


def main():
    options = arguments()
    mi.set_variant("scalar_rgb")
    bench = Bench(options)
    cases = {tuple(case.split(":")): None for case in options.cases}
    for scene, light in cases:
        cases[scene, light] = bench.measure(scene, light)
    text = report.markdown(options, cases, SILK, equivalent(SILK))
    if options.out:
        options.out.write_text(text)
    else:
        print(text)
    if options.picture:
        rows = [np.concatenate(list(pictures.values()), axis=1) for _, pictures in cases.values()]
        shown = np.clip(np.concatenate(rows), 0, 1) ** (1 / 2.2)
        mi.util.write_bitmap(str(options.picture), (255 * shown).astype(np.uint8), write_async=False)


if __name__ == "__main__":
    main()
