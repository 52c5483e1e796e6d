-- scripts/theses/s1_figure_3_13.lua: flat and smooth shading, and the shadow terminator.
--
--     lumbre run scripts/theses/s1_figure_3_13.lua              5 minutes
--     lumbre run scripts/theses/s1_figure_3_13.lua quick=true   10 seconds
--
-- Thesis S1 (docs/bibliography.md), section 3.3: figures 3.13 (flat), 3.14 (smooth) and 3.15 (the
-- terminator in another renderer, and hidden). Here: a coarse ball in the light of a studio for the
-- first two, and of a low sun for the terminator.

local x = experiment("s1_figure_3_13", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("light", { "lamps", "sky" })
x:axis("normals", { "flat", "smooth", "terminator hidden" })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    scene_options = { shape = "facets", light = p.light },
    integrator = "nee",
    max_depth = 4,
    resolution = p.quick and { 96, 96 } or { 256, 256 },
    set = {
      ["materials.*.shading_normals"] = p.normals == "flat" and "flat" or "smooth",
      ["materials.ball.shadow_terminator"] = p.normals == "terminator hidden",
    },
  }
end)
-- The sun's side of the ball is far brighter than the rest.
x:measure { every = "1s", display = tonemap.srgb { exposure = -2 } }
x:stop(function(p) return stop.samples(p.quick and 64 or 512) end)
x:sheet("normals", { rows = "light", cols = "normals", display = tonemap.reinhard { exposure = -1 } })
x:table("rate", { value = "mpaths_s", rows = "normals", cols = "light" })
return x
