"""Reference client of Lumbre's protocol for servers, version 1: docs/reference/external.md.

Arguments: width and height of the pictures. This one "renders" uniform noise around 0.5; replace `render`, and load
the scene before the line `ready`.
"""
import os
import random
import struct
import sys
import time

# Replies have standard output to themselves: whatever else prints there goes to the error output.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
width, height = map(int, sys.argv[1:3])


def render(spp, seed):
    """Returns linear radiance: three numbers for each pixel, the last row first."""
    rng = random.Random(seed)
    return [sum(rng.random() for _ in range(spp)) / spp for _ in range(3 * width * height)]


def reply(text):
    replies.write(text + "\n")
    replies.flush()


reply("ready 1 cpu, 1 threads, noise 1.0")
for request in sys.stdin:
    spp, seed, file = request.rstrip("\n").split(" ", 2)
    try:
        start = time.perf_counter()
        values = render(int(spp), int(seed))
        seconds = time.perf_counter() - start
        with open(file, "wb") as picture:
            picture.write(f"PF\n{width} {height}\n-1.0\n".encode() + struct.pack(f"<{len(values)}f", *values))
        reply(repr(seconds))
    except Exception as error:
        reply("failed " + str(error).replace("\n", " "))
