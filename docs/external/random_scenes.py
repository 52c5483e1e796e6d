#!/usr/bin/env python3
"""Writes random Mitsuba scenes within what Lumbre reads without a difference of model.

usage: random_scenes.py FOLDER COUNT [SEED]

Each scene has a floor, two to five shapes with random transforms, materials and textures, one to four lights and a
camera, in units from a hundredth to a thousand. Render them with both programs:

    lumbre verify --mitsuba FOLDER/*.xml
"""
import math
import random
import struct
import sys
import zlib
from pathlib import Path

METALS = ["Au", "Cu", "Al", "Ag", "W", "none"]
SIDES = [(64, 48), (48, 64), (64, 64), (80, 40)]


class Scene:
    """One scene; `unit` is the length of what is about one unit long."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.unit = self.random.choice([1, 1, 0.01, 100, 1000])

    def number(self, low, high):
        return self.random.uniform(low, high)

    def chance(self, probability):
        return self.random.random() < probability

    def point(self, *ranges):
        return ",".join(f"{self.unit * self.number(*r):.6g}" for r in ranges)

    def rgb(self, name, low, high):
        values = ",".join(f"{self.number(low, high):.6g}" for _ in range(3))
        return f'<rgb name="{name}" value="{values}"/>'

    def scalar(self, name, low, high):
        return f'<float name="{name}" value="{self.number(low, high):.6g}"/>'

    def length(self, name, low, high):
        return self.scalar(name, self.unit * low, self.unit * high)

    def placed_in_texture(self):
        if self.chance(0.4):
            return ""
        turn = f'<rotate z="1" angle="{self.number(0, 90):.6g}"/>' if self.chance(0.3) else ""
        scale = f'<scale x="{self.number(0.5, 6):.6g}" y="{self.number(0.5, 6):.6g}"/>'
        return f'<transform name="to_uv">{scale}{turn}</transform>'

    def color(self, name):
        kind = self.random.choice(["rgb", "rgb", "checkerboard", "bitmap"])
        if kind == "rgb":
            return self.rgb(name, 0.05, 0.95)
        if kind == "checkerboard":
            colors = self.rgb("color0", 0.05, 0.95) + self.rgb("color1", 0.05, 0.95)
            return f'<texture type="checkerboard" name="{name}">{colors}{self.placed_in_texture()}</texture>'
        raw = self.random.choice(["true", "false"])
        wrap = self.random.choice(["repeat", "mirror", "clamp"])
        reads = self.random.choice(["bilinear", "nearest"])
        return (
            f'<texture type="bitmap" name="{name}"><string name="filename" value="noise.png"/>'
            f'<boolean name="raw" value="{raw}"/><string name="wrap_mode" value="{wrap}"/>'
            f'<string name="filter_type" value="{reads}"/>{self.placed_in_texture()}</texture>'
        )

    def metal(self):
        if self.chance(0.5):
            return f'<string name="material" value="{self.random.choice(METALS)}"/>'
        return self.rgb("eta", 0.2, 3) + self.rgb("k", 1, 5)

    def facets(self):
        names = ["alpha"] if self.chance(0.5) else ["alpha_u", "alpha_v"]
        kind = self.random.choice(["ggx", "beckmann"])
        return f'<string name="distribution" value="{kind}"/>' + "".join(self.scalar(n, 0.05, 0.5) for n in names)

    def surface(self, kinds):
        kind = self.random.choice(kinds)
        opaque = ["diffuse", "plastic", "roughconductor"]
        inside = {
            "diffuse": lambda: self.color("reflectance"),
            "plastic": lambda: self.color("diffuse_reflectance") + self.scalar("int_ior", 1.2, 1.9),
            "conductor": self.metal,
            "roughconductor": lambda: self.metal() + self.facets(),
            "dielectric": lambda: self.scalar("int_ior", 1.1, 2.2),
            "principled": lambda: self.color("base_color") + self.scalar("roughness", 0.15, 1)
            + "".join(self.scalar(name, 0, 1) for name in ["metallic", "sheen", "flatness"] if self.chance(0.3)),
            "twosided": lambda: self.surface(opaque),
            "blendbsdf": lambda: self.scalar("weight", 0, 1) + self.surface(opaque[::2]) + self.surface(opaque[::2]),
        }
        return f'<bsdf type="{kind}">{inside[kind]()}</bsdf>'

    def shape(self, index):
        kind = self.random.choice(["sphere", "sphere", "cube", "cylinder", "disk", "rectangle"])
        turns = "".join(f'<rotate {axis}="1" angle="{self.number(0, 360):.6g}"/>' for axis in "xyz")
        uneven = kind in ("cube", "rectangle") and self.chance(0.5)
        stretch = "".join(f' {axis}="{self.number(0.4, 1.4):.6g}"' for axis in "xyz") if uneven else ' value="1"'
        x, z = (index % 3 - 1) * 1.6, index // 3 * 1.6 - 0.8
        place = f'x="{self.unit * x:.6g}" y="{self.unit * self.number(0.3, 1):.6g}" z="{self.unit * z:.6g}"'
        flip = '<boolean name="flip_normals" value="true"/>' if self.chance(0.15) else ""
        kinds = ["diffuse", "diffuse", "plastic", "conductor", "roughconductor", "dielectric"]
        surface = self.surface([*kinds, "principled", "principled", "twosided", "blendbsdf"])
        return (
            f'<shape type="{kind}">{flip}<transform name="to_world">{turns}<scale{stretch}/>'
            f'<scale value="{0.55 * self.unit:.6g}"/><translate {place}/></transform>{surface}</shape>'
        )

    def light(self, kind):
        squared = self.unit * self.unit
        if kind == "constant":
            return f'<emitter type="constant">{self.rgb("radiance", 0.2, 1)}</emitter>'
        if kind == "directional":
            towards = f'x="{self.number(-0.5, 0.5):.6g}" y="-1" z="{self.number(-0.5, 0.5):.6g}"'
            sun = self.rgb("irradiance", 0.5, 3)
            return f'<emitter type="directional"><vector name="direction" {towards}/>{sun}</emitter>'
        above = self.point((-2, 2), (3.5, 4), (0, 2))
        facing = f'<lookat origin="{above}" target="0,0,0" up="0,0,1"/>'
        if kind == "area":
            scale = f'<scale value="{self.unit * self.number(0.3, 1):.6g}"/>'
            lamp = f'<emitter type="area">{self.rgb("radiance", 3, 12)}</emitter>'
            shape = self.random.choice(["rectangle", "disk"])
            return f'<shape type="{shape}"><transform name="to_world">{scale}{facing}</transform>{lamp}</shape>'
        intensity = self.rgb("intensity", 5 * squared, 20 * squared)
        cone = self.scalar("cutoff_angle", 15, 40) if kind == "spot" else ""
        return f'<emitter type="{kind}">{intensity}{cone}<transform name="to_world">{facing}</transform></emitter>'

    def camera(self):
        width, height = self.random.choice(SIDES)
        lens = self.chance(0.2)
        eye, target = self.point((-3, 3), (1, 4), (5, 7)), f"0,{0.5 * self.unit:.6g},0"
        up = self.random.choice(["0,1,0", "0.2,1,0"])
        axis = self.random.choice(["x", "y", "smaller", "larger", "diagonal"])
        focus = self.length("aperture_radius", 0.02, 0.2) + self.length("focus_distance", 4, 8) if lens else ""
        size = f'<integer name="width" value="{width}"/><integer name="height" value="{height}"/>'
        return (
            f'<sensor type="{"thinlens" if lens else "perspective"}">{focus}{self.scalar("fov", 30, 60)}'
            f'<string name="fov_axis" value="{axis}"/><float name="far_clip" value="{1000 * self.unit:.6g}"/>'
            f'<float name="near_clip" value="{0.001 * self.unit:.6g}"/>'
            f'<transform name="to_world"><lookat origin="{eye}" target="{target}" up="{up}"/></transform>'
            f'<film type="hdrfilm">{size}<rfilter type="box"/></film></sensor>'
        )

    def xml(self):
        depth = self.random.choice([2, 3, 5, 8])
        integrator = f'<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>'
        kinds = [kind for kind in ["area", "constant", "directional", "point", "spot"] if self.chance(0.35)]
        lights = "".join(self.light(kind) for kind in kinds or ["area"])
        half = self.unit * self.random.choice([4, 4, 40])
        lying = f'<transform name="to_world"><scale value="{half:.6g}"/><rotate x="1" angle="-90"/></transform>'
        floor = f'<shape type="rectangle">{lying}{self.surface(["diffuse", "twosided"])}</shape>'
        shapes = "".join(self.shape(i) for i in range(self.random.randint(2, 5)))
        return f'<scene version="3.0.0">{integrator}{self.camera()}{lights}{floor}{shapes}</scene>\n'


def picture(width, height):
    """Returns a PNG of random colours."""
    rng = random.Random(width * height)
    rows = b"".join(b"\0" + bytes(rng.randrange(30, 230) for _ in range(3 * width)) for _ in range(height))

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def main():
    folder, count = Path(sys.argv[1]), int(sys.argv[2])
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "noise.png").write_bytes(picture(16, 8))
    digits = int(math.log10(max(count - 1, 1))) + 1
    for i in range(count):
        (folder / f"{seed}-{i:0{digits}}.xml").write_text(Scene(1_000_003 * seed + i).xml())


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main()
