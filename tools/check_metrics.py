#!/usr/bin/env python3
"""Figures of independent programs for the pictures in src/image/metric/tests.rs.

    python3 -m venv out/venv && out/venv/bin/pip install flip-evaluator scikit-image
    out/venv/bin/python tools/check_metrics.py                        prints the figures that the tests hold
    out/venv/bin/python tools/check_metrics.py target/release/yarnray also runs `yarnray compare` on files of these pictures

With the program, both are printed side by side; exit status 1 if any differs by more than 1e-4.
"""
import json
import subprocess
import sys
import tempfile

import flip_evaluator
import numpy as np
from skimage.io import imsave
from skimage.measure import block_reduce
from skimage.metrics import structural_similarity

WIDTH, HEIGHT = 96, 64
EPSILON = 1e-2


def noise(i):
    mask = np.uint64(0xFFFFFFFF)
    i = (i.astype(np.uint64) * np.uint64(2654435761)) & mask
    i ^= i >> np.uint64(15)
    i = (i * np.uint64(2246822519)) & mask
    i ^= i >> np.uint64(13)
    return i.astype(np.float64) / 2**32


def pictures():
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    reference = np.stack(
        [0.35 + 0.3 * np.sin(0.11 * x + 0.05 * y), 0.30 + 0.25 * np.cos(0.07 * x - 0.13 * y), 0.25 + 0.2 * np.sin(0.23 * y)], -1
    )
    reference = np.maximum(reference, 0)
    wave = 1 + 0.2 * np.sin(0.4 * x)
    index = y * WIDTH + x
    test = np.stack([reference[..., c] * wave + 0.1 * (noise(3 * index + c) - 0.5) for c in range(3)], -1)
    test = np.maximum(test, 0)

    def disc(center, gain):
        return np.where((x - center) ** 2 + (y - 20) ** 2 < 80, gain, 1.0)[..., None]

    bright = (test**2 * disc(61, 36.0), reference**2 * disc(60, 40.0))
    return [tuple(p.astype(np.float32) for p in pair) for pair in ((test, reference), bright)]


def encoded(v):
    v = np.clip(v.astype(np.float64), 0, 1)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def figures(test, reference):
    _, ldr, _ = flip_evaluator.evaluate(np.clip(reference, 0, 1), np.clip(test, 0, 1), "LDR", inputsRGB=False, applyMagma=False)
    _, hdr, _ = flip_evaluator.evaluate(reference, test, "HDR", applyMagma=False)
    similarity = structural_similarity(
        encoded(test), encoded(reference), gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, channel_axis=2
    )
    a, b = test.astype(np.float64), reference.astype(np.float64)
    out = {"flip_ldr": ldr, "flip_hdr": hdr, "ssim": similarity}
    for c, name in enumerate("rgb"):
        out["mean_ratio_" + name] = a[..., c].mean() / b[..., c].mean()
    for factor in (1, 2, 4, 8):
        reduced = [block_reduce(p, (factor, factor, 1), np.mean) for p in (a, b)]
        square = (reduced[0] - reduced[1]) ** 2
        relative = square / (reduced[1] ** 2 + EPSILON)
        pixels = np.sort(relative.mean(-1).ravel())
        suffix = "" if factor == 1 else f"_{factor}"
        out["rmse" + suffix] = np.sqrt(square.mean())
        out["relmse" + suffix] = relative.mean()
        out["relmse_trimmed" + suffix] = pixels[: len(pixels) - int(np.ceil(len(pixels) * 1e-3))].mean()
    return {name: float(value) for name, value in out.items()}


def ours(program, test, reference):
    with tempfile.TemporaryDirectory() as folder:
        names = []
        for name, picture in (("test", test), ("reference", reference)):
            names.append(f"{folder}/{name}.tif")
            imsave(names[-1], picture, check_contrast=False)
        found = json.loads(subprocess.check_output([program, "compare", *names, "--json"]))
    out = {name: found[name] for name in ("flip_ldr", "flip_hdr", "ssim")}
    out.update({"mean_ratio_" + name: value for name, value in zip("rgb", found["mean_ratio"])})
    for errors in found["errors"]:
        suffix = "" if errors["factor"] == 1 else f"_{errors['factor']}"
        out.update({name + suffix: errors[name] for name in ("rmse", "relmse", "relmse_trimmed")})
    return out


def main():
    agree = True
    for name, (test, reference) in zip(("plain", "bright"), pictures()):
        expected = figures(test, reference)
        found = ours(sys.argv[1], test, reference) if len(sys.argv) > 1 else {}
        print(name)
        for metric, value in expected.items():
            difference = abs(found.get(metric, value) - value) / max(1, abs(value))
            agree &= difference < 1e-4
            print(f"  {metric:18} {value:.9f}", f"{found[metric]:.9f}  {difference:.1e}" if found else "")
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
