"""Renders one scene with Mitsuba 3, as often as Lumbre asks.

Arguments: variant, integrator, scene file, width, height, max_depth, rr_depth, threads (0 is all). When the scene is
read, `ready VERSION THREADS` is written. Then every line `SPP SEED FILE` on standard input is answered by the seconds that
Mitsuba spent inside its renderer, once the picture is in FILE: EXR, linear radiance, 32-bit floats.
"""

import os
import sys
import time

# Whatever else writes to standard output, from Python or from below it, must not be taken for an answer.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import drjit as dr
import mitsuba as mi

variant, method, scene_file = sys.argv[1:4]
width, height, max_depth, rr_depth, threads = map(int, sys.argv[4:9])
mi.set_variant(variant)
mi.set_log_level(mi.LogLevel.Warn)
if threads > 0:
    dr.set_thread_count(threads)
scene = mi.load_file(scene_file, width=width, height=height, max_depth=max_depth, rr_depth=rr_depth, filter="box")
integrator = mi.load_dict({"type": method, "max_depth": max_depth, "rr_depth": rr_depth})


def answer(text):
    answers.write(text + "\n")
    answers.flush()


def render(spp, seed):
    start = time.perf_counter()
    image = mi.render(scene, integrator=integrator, spp=spp, seed=seed)
    # Variants that compile are lazy; a picture counts when it is there.
    dr.eval(image)
    dr.sync_thread()
    return image, time.perf_counter() - start


# Compiling kernels is no rendering.
if not variant.startswith("scalar"):
    render(1, 0)
answer(f"ready {mi.__version__} {dr.thread_count()}")
for line in sys.stdin:
    spp, seed, file = line.rstrip("\n").split(" ", 2)
    image, seconds = render(int(spp), int(seed))
    mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False).write(file)
    answer(repr(seconds))
