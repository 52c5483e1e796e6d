-- scripts/theses/s1_figure_4_1.lua: importance sampling of an environment.
--
--     lumbre run scripts/theses/s1_figure_4_1.lua                      3 minutes
--     lumbre run scripts/theses/s1_figure_4_1.lua quick=true           10 seconds
--     lumbre run scripts/theses/s1_figure_4_1.lua map=/path/to/sky.hdr
--
-- Thesis S1 (docs/bibliography.md), sections 3.2.2 and 4.1.2: figure 3.6 (an object lit by a map)
-- and figure 4.1 (a map with a sun, without and with importance sampling, after the same samples).
-- Here: a painted sky with a small sun, or the file `map`. `bpt` finds the sky by the directions of
-- the surface alone, as the document does without importance sampling.

local x = experiment("s1_figure_4_1", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("map", { "own" })
x:axis("sampling", { "by chance", "uniform", "luminance" })

x:render(function(p)
  local set = { ["environment.sampling"] = p.sampling == "luminance" and "luminance" or "uniform" }
  if p.map ~= "own" then set["environment.map"] = p.map end
  local chance = p.sampling == "by chance"
  return {
    scene = "scenes/material_ball.lua",
    scene_options = { shape = "knot", light = "sky" },
    integrator = chance and "bpt" or "nee",
    mis = not chance and "none" or nil,
    max_depth = 4,
    resolution = p.quick and { 64, 64 } or { 192, 192 },
    set = set,
  }
end)
x:reference {
  from = function() return { integrator = "nee", mis = "power", set = { ["environment.sampling"] = "luminance" } } end,
  stop = function(p) return stop.samples(p.quick and 2048 or 8192) end,
}
-- The sun lights the floor to several times white.
local display = tonemap.srgb { exposure = -2 }
x:measure { every = "10s", rmse = metric.rmse(), fireflies = metric.fireflies(), display = display }
x:stop(function(p) return stop.samples(p.quick and 64 or 256) end)
x:table("rmse", { value = "rmse", rows = "sampling" })
x:table("fireflies", { value = "fireflies", rows = "sampling" })
x:sheet("sampling", { cols = "sampling" })
return x
