"""Renders an exported scene with Cycles (`pip install bpy`): a server for `external`, docs/reference/external.md.

Arguments: scene (Mitsuba 3), width, height, edges of a path, threads. What the bridge translates is in
mitsuba_scene.py; anything else is an error. Lights and surfaces have one side in the exported scene and two sides
here. The clock includes the hierarchy, which Cycles builds for each picture.
"""
import math
import os
import sys
import time

# Blender prints to standard output, which belongs to the replies.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import bpy
from mathutils import Matrix, Vector

from mitsuba_scene import Scene

path = sys.argv[1]
width, height, depth, threads = map(int, sys.argv[2:6])


def reply(text):
    replies.write(text + "\n")
    replies.flush()


def shader(tree, output, kind, colour, strength=None):
    tree.nodes.clear()
    node, target = tree.nodes.new(kind), tree.nodes.new(output)
    node.inputs["Color"].default_value = (*colour, 1.0)
    if strength is not None:
        node.inputs["Strength"].default_value = strength
    tree.links.new(node.outputs[0], target.inputs["Surface"])


def add(shape, name):
    if shape["kind"] == "sphere":
        place = {"radius": shape["radius"], "location": shape["centre"]}
        bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, **place)
        thing = bpy.context.object
    else:
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(shape["positions"], [], shape["triangles"])
        thing = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(thing)
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    if shape["emission"]:
        shader(material.node_tree, "ShaderNodeOutputMaterial", "ShaderNodeEmission", shape["emission"], 1.0)
    else:
        shader(material.node_tree, "ShaderNodeOutputMaterial", "ShaderNodeBsdfDiffuse", shape["colour"])
    thing.data.materials.append(material)


def build(source):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for i, shape in enumerate(source.shapes):
        add(shape, f"shape{i}")
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    shader(scene.world.node_tree, "ShaderNodeOutputWorld", "ShaderNodeBackground", source.sky, 1.0)
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle_y = "VERTICAL", math.radians(source.fov)
    camera.clip_start, camera.clip_end = 1e-4, 1e6
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    back = (Vector(source.eye) - Vector(source.target)).normalized()
    right = Vector(source.up).cross(back).normalized()
    axes = Matrix((right, back.cross(right), back)).transposed().to_4x4()
    scene.camera.matrix_world = Matrix.Translation(source.eye) @ axes
    scene.render.engine = "CYCLES"
    cycles, render = scene.cycles, scene.render
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", False, False
    cycles.pixel_filter_type = "BOX"
    # Cycles counts bounces behind direct light.
    cycles.max_bounces = cycles.diffuse_bounces = max(0, depth - 2)
    cycles.min_light_bounces = depth
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.threads_mode, render.threads = "FIXED", threads
    render.dither_intensity = 0.0
    image = render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGB", "32"
    scene.view_settings.view_transform = "Raw"
    return scene


try:
    scene = build(Scene(path))
except Exception as error:
    sys.exit(f"{type(error).__name__}: {error}")
reply(f"ready 1 cpu, {threads} threads, Cycles {bpy.app.version_string}")
for request in sys.stdin:
    spp, seed, file = request.rstrip("\n").split(" ", 2)
    try:
        scene.cycles.samples, scene.cycles.seed = int(spp), int(seed)
        start = time.perf_counter()
        bpy.ops.render.render()
        seconds = time.perf_counter() - start
        bpy.data.images["Render Result"].save_render(file)
        reply(repr(seconds))
    except Exception as error:
        reply("failed " + str(error).replace("\n", " "))
