-- scripts/theses/s1_figure_5_1.lua: number of bins of the surface area heuristic.
--
--     lumbre run scripts/theses/s1_figure_5_1.lua                         3 minutes
--     lumbre run scripts/theses/s1_figure_5_1.lua quick=true              30 seconds
--     lumbre run scripts/theses/s1_figure_5_1.lua models=/path/to/models  the Stanford dragon
--
-- Thesis S1 (docs/bibliography.md), section 5.1.2: figure 5.1, build time and thousand paths a
-- second of the dragon over the number of bins. Its points, read from the document's source: 4 bins
-- 4.267 s and 8310, 6: 4.418 and 12012, 8: 4.628 and 12728, 10: 5.015 and 13100, 12: 5.440 and
-- 13046, 14: 5.782 and 13501, 16: 6.309 and 13458. A knot of this project replaces the dragon.

local x = experiment("s1_figure_5_1", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("models", { "own" })
x:axis("bins", { 4, 6, 8, 10, 12, 14, 16 })

x:render(function(p)
  return {
    scene = "scenes/model.lua",
    scene_options = { model = "dragon", folder = p.models ~= "own" and p.models or "" },
    integrator = "bpt",
    accel = { builder = "sah", bins = p.bins, max_depth = 18 },
    resolution = p.quick and { 128, 96 } or { 256, 192 },
  }
end)
x:measure { every = "1s" }
x:stop(function(p) return stop.time(p.quick and 0.4 or 4) end)
x:figure("bins", { x = "bins", y = { "accel_build_s", "mpaths_s", "accel_cost" } })
x:table("bins", { value = "mpaths_s", rows = "bins" })
return x
