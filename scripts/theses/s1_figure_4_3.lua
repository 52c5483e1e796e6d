-- scripts/theses/s1_figure_4_3.lua: importance sampling of metals.
--
--     lumbre run scripts/theses/s1_figure_4_3.lua              4 minutes
--     lumbre run scripts/theses/s1_figure_4_3.lua quick=true   15 seconds
--
-- Thesis S1 (docs/bibliography.md), section 4.1.3: figure 4.3, a metal whose paths continue in
-- uniform directions, or in those of its BRDF, after the same samples. `bpt` finds all light by
-- chance, so the directions alone differ.

local x = experiment("s1_figure_4_3", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("roughness", { 0.1, 0.3, 1 })
x:axis("directions", { "uniform", "bsdf" })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    integrator = "bpt",
    directions = p.directions,
    max_depth = 4,
    resolution = p.quick and { 48, 48 } or { 128, 128 },
    set = {
      ["materials.ball.metallic"] = 1,
      ["materials.ball.roughness"] = p.roughness,
      ["materials.ball.base_color"] = { 0.9, 0.7, 0.4 },
    },
  }
end)
x:reference {
  from = function() return { integrator = "nee", directions = "bsdf" } end,
  stop = function(p) return stop.samples(p.quick and 2048 or 8192) end,
}
x:measure { every = "10s", rmse = metric.rmse(), display = tonemap.srgb() }
x:stop(function(p) return stop.samples(p.quick and 128 or 1024) end)
x:table("rmse", { value = "rmse", rows = "roughness", cols = "directions" })
x:sheet("metals", { rows = "roughness", cols = "directions" })
return x
