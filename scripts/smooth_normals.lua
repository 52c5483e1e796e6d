-- scripts/smooth_normals.lua: flat and smooth shading, and the shadow terminator.
--
--     lumbre run scripts/smooth_normals.lua
--
-- After thesis S1, section 3.3 and figures 3.13 to 3.15 (docs/bibliography.md): a coarse mesh with
-- the normals of its triangles (`flat`) and with the interpolated normals of its vertices
-- (`smooth`). Interpolated normals differ from those of the triangles, so that light ends at the
-- edges of triangles: the shadow terminator. `shadow_terminator` hides it as the thesis does.
--
-- The ball has 80 triangles and is lit from the side by a low sun. Shading normals change only the
-- shading: the outline of the ball stays that of its triangles.
--
-- Results in out/latest:
--     runs/**/final.png    the ball with each kind of normals
--     tables/rate          million paths per second by normals

local x = experiment("smooth_normals", { seed = 313 })

x:axis("normals", { "flat", "smooth", "smooth, terminator hidden" })
x:axis("size", { 256 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    scene_options = { shape = "facets", light = "sky" },
    integrator = "nee",
    max_depth = 4,
    resolution = { p.size, p.size },
    set = {
      ["materials.*.shading_normals"] = p.normals == "flat" and "flat" or "smooth",
      ["materials.ball.shadow_terminator"] = p.normals == "smooth, terminator hidden",
    },
  }
end)

x:measure { every = "0.5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("rate", { value = "mpaths_s", rows = "normals" })

return x
