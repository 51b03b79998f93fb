"""Renders one job with Mitsuba 3, in a process of its own: mitsuba_worker.py JOB.json. Prints times and memory as JSON."""

import json
import sys
import time

import numpy as np

from job import peak_memory, picture_path


def light(job):
    if job["light"] == "sky":
        return {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
    return {
        "type": "directional",
        "direction": [-x for x in job["light"]["towards"]],
        "irradiance": {"type": "rgb", "value": job["light"]["irradiance"]},
    }


def scene(mi, job):
    camera, fiber = job["camera"], job["fiber"]
    largest = max(fiber["sigma"])
    return {
        "type": "scene",
        # Its depth counts the camera's and the light's own segments together.
        "integrator": {"type": "path", "max_depth": job["bounces"] + 1, "rr_depth": job["roulette_after"] + 1},
        "sensor": {
            "type": "perspective",
            "fov": camera["fov"],
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(camera["position"], camera["target"], [0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": job["size"][0],
                "height": job["size"][1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
            "sampler": {"type": job.get("sampler", "independent")},
        },
        "light": light(job),
        "fibers": {
            "type": "bsplinecurve",
            "filename": job["curves"],
            "bsdf": {
                "type": "hair",
                "sigma_a": {"type": "rgb", "value": [s / largest for s in fiber["sigma"]]},
                "scale": largest,
                "int_ior": fiber["ior"],
                "ext_ior": 1.0,
                "longitudinal_roughness": fiber["longitudinal"],
                "azimuthal_roughness": fiber["azimuthal"],
                "scale_tilt": 0.0,
            },
        },
    }


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(job["variant"])
    dr.set_thread_count(job["threads"])
    imported = peak_memory()

    started = time.perf_counter()
    ready = mi.load_dict(scene(mi, job))
    # The first render compiles kernels.
    np.asarray(mi.render(ready, spp=1, seed=12345))
    build = time.perf_counter() - started

    started = time.perf_counter()
    total = 0
    for i in range(job["passes"]):
        total = total + np.asarray(mi.render(ready, spp=job["spp"], seed=job["seed"] + i))
    render = time.perf_counter() - started
    np.save(picture_path(job), (total / job["passes"]).astype(np.float32))
    print(json.dumps({"build": build, "render": render, "memory": peak_memory(), "imported": imported}))


main()
