"""Renders one scene with Mitsuba 3, once for each request from Lumbre: a server of its protocol for external renderers.

Arguments: variant, integrator, scene file, width, height, max_depth, threads.
"""

import os
import sys
import time

# Anything else that writes to standard output, from Python or from native code, must not be taken
# for a reply.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import drjit as dr
import mitsuba as mi

variant, method, scene_file = sys.argv[1:4]
width, height, max_depth, threads = map(int, sys.argv[4:8])
# Roulette starts beyond the last edge, so it has no effect.
rr_depth = max_depth + 1
is_scalar = variant.startswith("scalar")
mi.set_variant(variant)
mi.set_log_level(mi.LogLevel.Warn)
dr.set_thread_count(threads)
dr.set_flag(dr.JitFlag.KernelHistory, True)
scene = mi.load_file(scene_file, width=width, height=height, max_depth=max_depth, rr_depth=rr_depth, filter="box")
integrator = mi.load_dict({"type": method, "max_depth": max_depth, "rr_depth": rr_depth})


def reply(text):
    replies.write(text + "\n")
    replies.flush()


def compile_time():
    """Returns the seconds that kernels were compiled for since the last call."""
    if is_scalar:
        return 0
    compiled = (kernel for kernel in dr.kernel_history() if not kernel.get("cache_hit"))
    return sum(kernel.get("codegen_time", 0) + kernel.get("backend_time", 0) for kernel in compiled) / 1000


def render(spp, seed):
    compile_time()
    start = time.perf_counter()
    image = mi.render(scene, integrator=integrator, spp=spp, seed=seed)
    # Compiled variants are lazy; the time ends when the picture has been computed.
    dr.eval(image)
    dr.sync_thread()
    return image, time.perf_counter() - start - compile_time()


# Most kernels are compiled before the first timed wave; other numbers of samples need others.
if not is_scalar:
    render(1, 0)
device = "cuda" if variant.startswith("cuda") else f"cpu, {dr.thread_count()} threads"
reply(f"ready 1 {device}, Mitsuba {mi.__version__} {variant} {method}")
for line in sys.stdin:
    spp, seed, file = line.rstrip("\n").split(" ", 2)
    image, seconds = render(int(spp), int(seed))
    mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False).write(file)
    reply(repr(seconds))
