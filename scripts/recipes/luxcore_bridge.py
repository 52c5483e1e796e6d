"""Renders an exported scene with LuxCore (`pip install pyluxcore`): a server, docs/reference/external.md.

Arguments: engine (PATHCPU or BIDIRCPU), scene (Mitsuba 3), width, height, edges of a path, threads. What the bridge
translates is in mitsuba_scene.py; anything else is an error. Lights and surfaces have one side in the exported
scene and two sides here.
"""
import math
import os
import sys
import time

# LuxCore prints to standard output, which belongs to the replies.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import pyluxcore

from mitsuba_scene import Scene

engine, path = sys.argv[1:3]
width, height, depth, threads = map(int, sys.argv[3:7])


def reply(text):
    replies.write(text + "\n")
    replies.flush()


def properties(pairs):
    props = pyluxcore.Properties()
    for name, values in pairs.items():
        props.Set(pyluxcore.Property(name, values))
    return props


def translated(source):
    scene = pyluxcore.Scene()
    scene.Parse(properties({
        "scene.camera.type": "perspective", "scene.camera.lookat.orig": source.eye,
        "scene.camera.lookat.target": source.target, "scene.camera.up": source.up, "scene.camera.fieldofview": source.fov,
        # The film of LuxCore 2.11 is one row lower than its window.
        "scene.camera.screenwindow": [-width / height, width / height, -1.0 - 2.0 / height, 1.0 - 2.0 / height],
        "scene.camera.autofocus.enable": False,
        "scene.camera.lensradius": 0.0}))
    for i, shape in enumerate(source.shapes):
        pairs = {f"scene.materials.m{i}.type": "matte", f"scene.materials.m{i}.kd": shape["colour"]}
        if shape["emission"]:
            # With a power of 0, emission is radiance; the gain of (1, 1, 1) keeps its colour.
            pairs |= {f"scene.materials.m{i}.emission": shape["emission"], f"scene.materials.m{i}.emission.power": 0.0,
                      f"scene.materials.m{i}.emission.gain": [1.0, 1.0, 1.0],
                      f"scene.materials.m{i}.emission.normalizebycolor": False}
        scene.Parse(properties(pairs))
        if shape["kind"] == "sphere":
            mesh = sphere(shape["centre"], shape["radius"])
        else:
            mesh = shape["positions"], shape["triangles"]
        positions, triangles = [tuple(p) for p in mesh[0]], [tuple(t) for t in mesh[1]]
        scene.DefineMesh(f"mesh{i}", positions, triangles, None, None, None, None, None)
        scene.Parse(properties({f"scene.objects.o{i}.shape": f"mesh{i}", f"scene.objects.o{i}.material": f"m{i}"}))
    if any(source.sky):
        scene.Parse(properties({"scene.lights.sky.type": "constantinfinite", "scene.lights.sky.color": source.sky}))
    return scene


def sphere(centre, radius, rings=48):
    """Returns a mesh of a sphere, whose silhouette is off by at most 0.2 % of the radius. LuxCore has no spheres."""
    positions = [(centre[0], centre[1] + radius, centre[2])]
    for ring in range(1, rings):
        y, out = math.cos(math.pi * ring / rings), math.sin(math.pi * ring / rings)
        for step in range(2 * rings):
            a, side = math.pi * step / rings, radius * out
            offset = side * math.cos(a), radius * y, side * math.sin(a)
            positions.append(tuple(c + o for c, o in zip(centre, offset)))
    positions.append((centre[0], centre[1] - radius, centre[2]))
    at = lambda ring, step: 1 + (ring - 1) * 2 * rings + step % (2 * rings)
    triangles = []
    for step in range(2 * rings):
        last = rings - 1
        triangles += [(0, at(1, step + 1), at(1, step)), (at(last, step), at(last, step + 1), len(positions) - 1)]
        for ring in range(1, rings - 1):
            triangles += [(at(ring, step), at(ring, step + 1), at(ring + 1, step)),
                          (at(ring, step + 1), at(ring + 1, step + 1), at(ring + 1, step))]
    return positions, triangles


def render(spp, seed):
    """Returns float values, the last row first, and the render time in seconds."""
    config = pyluxcore.RenderConfig(properties({
        "renderengine.type": engine, "renderengine.seed": seed % 0x7ffffffe + 1, "native.threads.count": threads,
        "sampler.type": "RANDOM", "sampler.random.adaptive.strength": 0.0,
        "path.pathdepth.total": depth, "path.pathdepth.diffuse": depth, "path.pathdepth.glossy": depth,
        "path.pathdepth.specular": depth, "path.russianroulette.depth": 10000,
        # Of each subpath: paths of BIDIRCPU may be longer.
        "light.maxdepth": depth, "path.maxdepth": depth,
        "film.width": width, "film.height": height, "film.filter.type": "BOX", "film.filter.width": 0.5,
        "film.outputs.1.type": "RGB", "film.outputs.1.filename": "unused.exr",
        "film.imagepipelines.0.0.type": "NOP", "batch.haltspp": spp}), scene)
    session = pyluxcore.RenderSession(config)
    session.Start()
    start = time.perf_counter()
    while not session.HasDone():
        time.sleep(0.001)
        session.UpdateStats()
    seconds = time.perf_counter() - start
    session.UpdateStats()
    film = session.GetFilm()
    buffer = bytearray(12 * width * height)
    film.GetOutputFloat(pyluxcore.FilmOutputType.RGB, buffer, 0)
    session.Stop()
    return bytes(buffer), seconds


try:
    pyluxcore.Init()
    scene = translated(Scene(path))
except Exception as error:
    sys.exit(f"{type(error).__name__}: {error}")
reply(f"ready 1 cpu, {threads} threads, LuxCore {pyluxcore.Version()} {engine}")
for request in sys.stdin:
    spp, seed, file = request.rstrip("\n").split(" ", 2)
    try:
        values, seconds = render(int(spp), int(seed))
        with open(file, "wb") as picture:
            picture.write(f"PF\n{width} {height}\n-1.0\n".encode() + values)
        reply(repr(seconds))
    except Exception as error:
        reply("failed " + str(error).replace("\n", " "))
