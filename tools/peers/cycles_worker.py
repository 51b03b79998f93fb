"""Renders one job with Cycles, in a process of its own: cycles_worker.py JOB.json. Prints times and memory as JSON."""

import json
import os
import sys
import tempfile
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector

from job import peak_memory, picture_path


def read_fibers(path):
    """Control points of uniform cubic B-splines, x y z radius: one array for each fibre."""
    with open(path) as file:
        blocks = file.read().split("\n\n")
    lines = ("\n".join(line for line in block.splitlines() if not line.startswith("#")) for block in blocks)
    return [np.array(text.split(), dtype=np.float64).reshape(-1, 4) for text in lines if text]


def add_fibers(paths):
    """Cycles draws Catmull-Rom curves through its points: it gets the places of the B-splines' knots."""
    knots = [(p[:-2] + 4 * p[1:-1] + p[2:]) / 6 for p in paths]
    points = np.concatenate(knots).astype(np.float32)
    curves = bpy.data.hair_curves.new("fibers")
    curves.add_curves([len(k) for k in knots])
    curves.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(points[:, :3]).ravel())
    radius = curves.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.ascontiguousarray(points[:, 3]))
    return curves


def add_material(curves, fiber):
    material = bpy.data.materials.new("fiber")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    hair = nodes.new("ShaderNodeBsdfHairPrincipled")
    hair.model = "CHIANG"
    hair.parametrization = "ABSORPTION"
    values = {
        "Absorption Coefficient": fiber["sigma"],
        "Roughness": fiber["longitudinal"],
        "Radial Roughness": fiber["azimuthal"],
        "IOR": fiber["ior"],
        "Coat": 0.0,
        "Offset": 0.0,
        "Random Roughness": 0.0,
    }
    for name, value in values.items():
        hair.inputs[name].default_value = value
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(hair.outputs["BSDF"], output.inputs["Surface"])
    curves.materials.append(material)


def add_object(scene, name, data):
    made = bpy.data.objects.new(name, data)
    scene.collection.objects.link(made)
    return made


def add_light(scene, light):
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    background.inputs["Strength"].default_value = 1.0 if light == "sky" else 0.0
    scene.world = world
    if light != "sky":
        sun = bpy.data.lights.new("light", "SUN")
        sun.energy = light["irradiance"]
        sun.angle = 0.0
        add_object(scene, "light", sun).rotation_euler = Vector(light["towards"]).to_track_quat("Z", "Y").to_euler()


def add_camera(scene, camera, size):
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "VERTICAL"
    data.angle_y = np.radians(camera["fov"])
    data.clip_end = 1e5
    position, target = Vector(camera["position"]), Vector(camera["target"])
    back = (position - target).normalized()
    right = Vector((0, 1, 0)).cross(back).normalized()
    axes = Matrix((right, back.cross(right), back)).transposed().to_4x4()
    scene.camera = add_object(scene, "camera", data)
    scene.camera.matrix_world = Matrix.Translation(position) @ axes
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100


def settings(scene, job):
    """The plain path tracer: no denoiser, no adaptive sampling, no clamping, nothing blurred."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.threads_mode = "FIXED"
    render.threads = job["threads"]
    render.use_persistent_data = True
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    scene.cycles_curves.shape = "THICK"
    chosen = {
        "device": "CPU",
        "use_denoising": False,
        "use_adaptive_sampling": False,
        "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0,
        "blur_glossy": 0.0,
        "pixel_filter_type": "BOX",
        "filter_width": 1.0,
        # Its bounces are those after the first scattering.
        **{f"{kind}bounces": job["bounces"] - 1 for kind in ("max_", "diffuse_", "glossy_", "transmission_")},
        "transparent_max_bounces": job["bounces"],
        "min_light_bounces": job["roulette_after"],
        **job.get("cycles", {}),
    }
    for name, value in chosen.items():
        setattr(cycles, name, value)


def rendered(scene, spp, seed):
    """The picture of one render, and its seconds."""
    scene.cycles.samples = spp
    scene.cycles.seed = seed
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "picture.exr")
        started = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        seconds = time.perf_counter() - started
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        width, height = image.size
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[::-1, :, :3], seconds


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    # Blender tells of its renders on standard output, where the result goes.
    result = os.dup(1)
    os.dup2(2, 1)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    imported = peak_memory()
    scene = bpy.context.scene
    curves = add_fibers(read_fibers(job["curves"]))
    add_material(curves, job["fiber"])
    add_object(scene, "fibers", curves)
    add_light(scene, job["light"])
    add_camera(scene, job["camera"], job["size"])
    settings(scene, job)

    # The first render builds the BVH, which later ones keep.
    _, build = rendered(scene, 1, 12345)
    total, render = 0.0, 0.0
    for i in range(job["passes"]):
        picture, seconds = rendered(scene, job["spp"], job["seed"] + i)
        total = total + picture
        render += seconds
    np.save(picture_path(job), total / job["passes"])
    os.write(result, json.dumps({"build": build, "render": render, "memory": peak_memory(), "imported": imported}).encode())


main()
