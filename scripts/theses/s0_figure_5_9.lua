-- scripts/theses/s0_figure_5_9.lua: convergence in the Cornell box.
--
--     lumbre run scripts/theses/s0_figure_5_9.lua                      50 minutes
--     lumbre run scripts/theses/s0_figure_5_9.lua quick=true           4 minutes
--     lumbre run scripts/theses/s0_figure_5_9.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), sections 5.2.1, 5.3.2 and 5.3.6: figures 5.2 (the box), 5.8
-- (pictures after 5 s), 5.9 (SSIM over time), 5.18 and 5.19 (spheres beside triangle meshes).
--
-- The document: 1280x720, five path edges, 50 s (100 s with meshes) on two graphics cards, metrics
-- every 0.5 s, a reference of 50 minutes for each technique. Here: fewer pixels for two cores, one
-- reference for all techniques, five repeats. `folder` has the document's scenes.

local s0 = require("lib.s0")

local x = s0.convergence("s0_figure_5_9", {
  stages = { "cornell-spheres", "cornell-balls" },
  size = { { 320, 180 }, { 64, 36 } },
  seconds = { 60, 5 },
})
x:skip("figures 5.18 and 5.19 compare bpt and bdpt", function(p)
  return p.stage == "cornell-balls" and p.technique:find("nee") ~= nil
end)
x:sheet("after_5_s", { rows = "stage", cols = "technique", at = "5s" })
return x
