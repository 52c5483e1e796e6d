"""A path tracer for diffuse spheres under a uniform sky, of the kind that one writes in an afternoon.

Arguments: scene (Mitsuba 3), width, height, edges of a path, samples per pixel, seed, and the picture to write.
"""
import json
import math
import random
import struct
import sys
import time
import xml.etree.ElementTree as xml

width, height, depth, spp, seed = map(int, sys.argv[2:7])
scene, rng = xml.parse(sys.argv[1]).getroot(), random.Random(seed)


def numbers(element):
    return [float(x) for x in element.get("value").replace(",", " ").split()]


def sub(a, b, s=1.0):
    return [x - s * y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(a):
    return [x / math.sqrt(dot(a, a)) for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


sky = numbers(scene.find("emitter[@type='constant']/rgb"))
albedo = {bsdf.get("id"): numbers(bsdf.find(".//rgb[@name='reflectance']")) for bsdf in scene.findall("bsdf")}
spheres = [([float(s.find("point").get(axis)) for axis in "xyz"], float(s.find("float").get("value")),
            albedo[s.find("ref").get("id")]) for s in scene.findall("shape[@type='sphere']")]
sensor = scene.find("sensor")
look = sensor.find("transform/lookat")
eye, target, up = ([float(x) for x in look.get(key).split(",")] for key in ("origin", "target", "up"))
forward = unit(sub(target, eye))
right = unit(cross(forward, up))
scale = math.tan(math.radians(float(sensor.find("float[@name='fov']").get("value"))) / 2)


def radiance(at, to):
    weight = [1.0, 1.0, 1.0]
    for _ in range(depth):
        hits = []
        for centre, radius, colour in spheres:
            b, c = dot(sub(at, centre), to), dot(sub(at, centre), sub(at, centre)) - radius * radius
            if b * b > c and -b - math.sqrt(b * b - c) > 1e-6:
                hits.append((-b - math.sqrt(b * b - c), centre, colour))
        if not hits:
            return [w * s for w, s in zip(weight, sky)]
        distance, centre, colour = min(hits)
        at = sub(at, to, -distance)
        normal, weight = unit(sub(at, centre)), [w * c for w, c in zip(weight, colour)]
        z, angle = 1 - 2 * rng.random(), 2 * math.pi * rng.random()
        radial = math.sqrt(max(0.0, 1 - z * z))
        # A point of the unit sphere on top of the normal is distributed as the cosine.
        to = unit(sub(normal, [radial * math.cos(angle), radial * math.sin(angle), z], -0.999999))
    return [0.0, 0.0, 0.0]


start, picture = time.perf_counter(), []
for row in reversed(range(height)):
    for column in range(width):
        pixel = [0.0, 0.0, 0.0]
        for _ in range(spp):
            x = (2 * (column + rng.random()) / width - 1) * scale * width / height
            y = (1 - 2 * (row + rng.random()) / height) * scale
            to = unit(sub(sub(forward, right, -x), cross(right, forward), -y))
            pixel = sub(pixel, radiance(eye, to), -1 / spp)
        picture += pixel
with open(sys.argv[7], "wb") as file:
    file.write(f"PF\n{width} {height}\n-1.0\n".encode() + struct.pack(f"<{len(picture)}f", *picture))
print(json.dumps({"seconds": time.perf_counter() - start}))
