"""Reads the part of an exported Mitsuba 3 scene that the bridges to LuxCore and Cycles translate.

Read are: one camera without a lens, spheres and triangle meshes, diffuse surfaces of one colour, area lights and a
uniform sky. Anything else is an error that names it, so that no scene is rendered with something left out.
"""
import pathlib
import struct
import xml.etree.ElementTree as xml


class Unsupported(Exception):
    """A feature of the scene that the bridges do not translate."""


def numbers(text):
    return [float(x) for x in text.replace(",", " ").split()]


def value(element, name):
    return element.find(f"*[@name='{name}']").get("value")


def read_mesh(path):
    """Returns the positions and triangles of a binary PLY file as the export writes it."""
    data = path.read_bytes()
    header, data = data.split(b"end_header\n", 1)
    kinds, counts, current = {"vertex": [], "face": []}, {}, ""
    for words in (line.split() for line in header.decode().splitlines()):
        if words[0] == "element":
            current, counts[words[1]] = words[1], int(words[2])
        elif words[0] == "property":
            kinds[current].append(words[1])
    if any(kind != "float" for kind in kinds["vertex"]) or kinds["face"] != ["list"]:
        raise Unsupported(f"{path.name}: properties of the mesh")
    width = len(kinds["vertex"])
    rows = struct.iter_unpack(f"<{width}f", data[:4 * width * counts["vertex"]])
    positions = [row[:3] for row in rows]
    faces = struct.iter_unpack("<B3i", data[4 * width * counts["vertex"]:])
    return positions, [face[1:] for face in faces]


def matrix(shape):
    element = shape.find("transform[@name='to_world']/matrix")
    if element is None:
        return None
    m = numbers(element.get("value"))
    return [m[0:4], m[4:8], m[8:12]]


def moved(m, p):
    return tuple(sum(row[i] * p[i] for i in range(3)) + row[3] for row in m) if m else tuple(p)


def colour(bsdf):
    """Returns the reflectance of a diffuse surface."""
    if bsdf.get("type") == "twosided":
        bsdf = bsdf.find("bsdf")
    reflectance = bsdf.find("rgb[@name='reflectance']")
    if bsdf.get("type") != "diffuse" or reflectance is None:
        raise Unsupported(f"the surface `{bsdf.get('type')}`, or its texture; only diffuse ones of one colour")
    return numbers(reflectance.get("value"))


class Scene:
    """Camera, shapes and sky. Shapes are dicts with `kind`, `colour`, `emission`, and their geometry in world space."""

    def __init__(self, path):
        root, folder = xml.parse(path).getroot(), pathlib.Path(path).parent
        sensor = root.find("sensor")
        if sensor.get("type") != "perspective":
            raise Unsupported(f"the camera `{sensor.get('type')}`")
        self.fov = float(value(sensor, "fov"))
        look = sensor.find("transform/lookat")
        self.eye, self.target, self.up = (numbers(look.get(key)) for key in ("origin", "target", "up"))
        surfaces = {bsdf.get("id"): bsdf for bsdf in root.findall("bsdf")}
        self.shapes = [self.shape(shape, surfaces, folder) for shape in root.findall("shape")]
        self.sky = [0.0, 0.0, 0.0]
        for emitter in root.findall("emitter"):
            if emitter.get("type") != "constant":
                raise Unsupported(f"the light `{emitter.get('type')}`")
            self.sky = numbers(value(emitter, "radiance"))

    @staticmethod
    def shape(shape, surfaces, folder):
        kind = shape.get("type")
        found = {"kind": kind, "emission": None, "colour": colour(surfaces[shape.find("ref").get("id")])}
        emitter = shape.find("emitter")
        if emitter is not None:
            found["emission"] = numbers(value(emitter, "radiance"))
        if kind == "sphere":
            centre = shape.find("point[@name='center']")
            found["centre"] = [float(centre.get(axis)) for axis in "xyz"]
            found["radius"] = float(value(shape, "radius"))
        elif kind == "ply":
            positions, found["triangles"] = read_mesh(folder / value(shape, "filename"))
            placed = matrix(shape)
            found["positions"] = [moved(placed, p) for p in positions]
        else:
            raise Unsupported(f"the shape `{kind}`")
        return found
