"""Renders scenes with Mitsuba 3 for `lumbre verify --mitsuba`.

The argument is the variant. The version is written to standard output. Each line on standard input is a request: a JSON
object with `scene`, `out`, `pictures`, `spp` and `seed`; pictures with consecutive seeds are written to OUT_0.exr and so
on (EXR, linear radiance, 32-bit floats). The reply is `done`, or `error` with a message.
"""

import json
import os
import sys

# Anything else that writes to standard output, from Python or from native code, must not be taken
# for a reply.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import mitsuba as mi

mi.set_variant(sys.argv[1])
mi.set_log_level(mi.LogLevel.Error)


def reply(text):
    replies.write(" ".join(text.split()) + "\n")
    replies.flush()


def render(request):
    scene = mi.load_file(request["scene"])
    for i in range(request["pictures"]):
        image = mi.render(scene, spp=request["spp"], seed=request["seed"] + i)
        rgb = mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        rgb.write(f"{request['out']}_{i}.exr")


reply(mi.__version__)
for line in sys.stdin:
    try:
        render(json.loads(line))
        reply("done")
    except Exception as e:
        reply(f"error {e}")
