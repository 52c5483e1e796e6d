"""Renders scenes with Mitsuba 3 for `lumbre verify --mitsuba`.

The argument is the variant. The version is written to standard output. Each line on standard input is a request: a JSON
object with `scene`, `out`, `pictures`, `spp`, `seed` and `view`; pictures with consecutive seeds are written to OUT_0.exr
and so on (EXR, linear radiance, 32-bit floats). A `view` that is not null replaces film, filter, field of view and depth
of the scene. The reply is `done`, or `error` with a message.
"""

import json
import os
import sys

# Anything else that writes to standard output, from Python or from native code, must not be taken
# for a reply.
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import drjit as dr
import mitsuba as mi

mi.set_variant(sys.argv[1])
mi.set_log_level(mi.LogLevel.Error)


class DiffuseTransmitter(mi.BSDF):
    """The plugin `difftrans` of version 0.6, which version 3 lacks: ideal diffuse transmission."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.transmittance = mi.Color3f(props["transmittance"])
        self.m_flags = mi.BSDFFlags.DiffuseTransmission | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [self.m_flags]

    def sample(self, context, si, sample1, sample2, active=True):
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        s = mi.BSDFSample3f()
        s.pdf = mi.warp.square_to_cosine_hemisphere_pdf(wo)
        s.wo = mi.Vector3f(wo.x, wo.y, dr.select(si.wi.z > 0, -wo.z, wo.z))
        s.eta = 1
        s.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseTransmission)
        s.sampled_component = 0
        return s, dr.select(active & (si.wi.z != 0) & (s.pdf > 0), self.transmittance, 0)

    def eval(self, context, si, wo, active=True):
        return self.transmittance * self.pdf(context, si, wo, active)

    def pdf(self, context, si, wo, active=True):
        return dr.select(active & (si.wi.z * wo.z < 0), dr.abs(wo.z) / dr.pi, 0)

    def eval_pdf(self, context, si, wo, active=True):
        return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)


mi.register_bsdf("difftrans", DiffuseTransmitter)


def reply(text):
    replies.write(" ".join(text.split()) + "\n")
    replies.flush()


def small_view(scene, view):
    """Returns a sensor like that of the scene, and an integrator, for a small picture."""
    original = scene.sensors()[0]
    params = mi.traverse(original)
    width, height = view["size"]
    right, down = view["offset"]
    sensor = {
        "type": "thinlens" if "aperture_radius" in params else "perspective",
        "to_world": original.world_transform(),
        "near_clip": params["near_clip"],
        "far_clip": params["far_clip"],
        "film": {"type": "hdrfilm", "width": width, "height": height, "filter": {"type": "box"}},
    }
    if "x_fov" in params:
        sensor["fov"], sensor["fov_axis"] = view["fov_y"], "y"
        if "aperture_radius" not in params:
            sensor["principal_point_offset_x"], sensor["principal_point_offset_y"] = right, down
    else:
        # The scale is half the width of the picture, where the whole width is 2 and x is to the left.
        before = original.film().size()
        half = view["shown"] * before[1] / before[0]
        scale = half * width / height
        middle = [-2 * right * scale, -2 * down * half, 0]
        sensor["type"] = "orthographic"
        moved = mi.ScalarTransform4f().translate(middle).scale([scale, scale, 1])
        sensor["to_world"] = original.world_transform() @ moved
    if "aperture_radius" in params:
        sensor["aperture_radius"] = params["aperture_radius"]
        sensor["focus_distance"] = params["focus_distance"]
    path = {"type": "path", "max_depth": view["max_depth"], "rr_depth": 1000}
    return mi.load_dict(sensor), mi.load_dict(path)


def render(request):
    scene = mi.load_file(request["scene"])
    sensor, integrator = 0, None
    if request["view"]:
        sensor, integrator = small_view(scene, request["view"])
    for i in range(request["pictures"]):
        seed = request["seed"] + i
        image = mi.render(scene, sensor=sensor, integrator=integrator, spp=request["spp"], seed=seed)
        rgb = mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        rgb.write(f"{request['out']}_{i}.exr")


reply(mi.__version__)
for line in sys.stdin:
    try:
        render(json.loads(line))
        reply("done")
    except Exception as e:
        reply(f"error {e}")
