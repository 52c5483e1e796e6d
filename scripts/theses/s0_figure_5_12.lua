-- scripts/theses/s0_figure_5_12.lua: convergence in the room of the lamps.
--
--     lumbre run scripts/theses/s0_figure_5_12.lua              30 minutes
--     lumbre run scripts/theses/s0_figure_5_12.lua quick=true   1 minute
--     lumbre run scripts/theses/s0_figure_5_12.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), sections 5.2.2 and 5.3.4: figures 5.3 (the room), 5.12 (RMSE
-- over time), 5.13 (SSIM over time).
--
-- The document: 1280x720, five path edges, 350 s on two graphics cards, metrics every 0.5 s, a
-- reference of 50 minutes for each technique. Here: fewer pixels for two cores, one reference for
-- all techniques, five repeats. `folder` has the document's scene.

local s0 = require("lib.s0")

local x = s0.convergence("s0_figure_5_12", {
  stages = { "veach-lamps" },
  size = { { 320, 180 }, { 96, 54 } },
  seconds = { 60, 2 },
})
x:sheet("pictures", { cols = "technique" })
return x
