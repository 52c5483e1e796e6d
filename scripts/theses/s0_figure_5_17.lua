-- scripts/theses/s0_figure_5_17.lua: convergence in the court under small lamps.
--
--     lumbre run scripts/theses/s0_figure_5_17.lua              one hour
--     lumbre run scripts/theses/s0_figure_5_17.lua quick=true   2 minutes
--
-- Thesis S0 (docs/bibliography.md), sections 5.2.4 and 5.3.5: figures 5.16 (the court) and 5.17
-- (SSIM over time, from the court and from the gallery).
--
-- The document: Sponza with many small lamps inside; 1280x720, five path edges, 350 s on two
-- graphics cards, metrics every 0.5 s, a reference of 50 minutes for each technique. Here: a court
-- of this project with eleven lamps, fewer pixels for two cores, one reference for all techniques.

local s0 = require("lib.s0")

local x = s0.convergence("s0_figure_5_17", {
  stages = { "atrium-lamps", "gallery-lamps" },
  size = { { 320, 180 }, { 96, 54 } },
  seconds = { 60, 2 },
})
x:sheet("views", { rows = "stage", cols = "technique" })
return x
