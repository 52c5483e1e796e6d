-- scripts/theses/s0_figure_5_15.lua: convergence in the court under a sky.
--
--     lumbre run scripts/theses/s0_figure_5_15.lua              one hour
--     lumbre run scripts/theses/s0_figure_5_15.lua quick=true   2 minutes
--
-- Thesis S0 (docs/bibliography.md), sections 5.2.4 and 5.3.5: figures 5.5 (both views) and 5.15
-- (SSIM over time, from the court and from the gallery).
--
-- The document: Sponza in a large emissive mesh, most of whose light the roof hides; 1280x720, five
-- path edges, 150 s on a graphics card, metrics every 0.5 s, a reference of 50 minutes for each
-- technique. Here: a court of this project under a painted sky, fewer pixels for two cores, one
-- reference for all techniques.

local s0 = require("lib.s0")

local x = s0.convergence("s0_figure_5_15", {
  stages = { "atrium-sky", "gallery-sky" },
  size = { { 320, 180 }, { 96, 54 } },
  seconds = { 60, 2 },
})
x:sheet("views", { rows = "stage", cols = "technique" })
return x
