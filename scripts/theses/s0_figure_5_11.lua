-- scripts/theses/s0_figure_5_11.lua: convergence in the bedroom.
--
--     lumbre run scripts/theses/s0_figure_5_11.lua              30 minutes
--     lumbre run scripts/theses/s0_figure_5_11.lua quick=true   1 minute
--
-- Thesis S0 (docs/bibliography.md), sections 5.2.3 and 5.3.3: figures 5.4 (the room), 5.10
-- (pictures by bdpt and bpt after 1 s and 20 s), 5.11 (SSIM over time).
--
-- The document: 1280x720, five path edges, 200 s on two graphics cards, metrics every 0.5 s, a
-- reference of 50 minutes for each technique. Its bedroom is not published: a room of this project
-- replaces it, so times differ and the order of techniques should not.

local s0 = require("lib.s0")

local x = s0.convergence("s0_figure_5_11", {
  stages = { "bedroom" },
  size = { { 320, 180 }, { 96, 54 } },
  seconds = { 60, 2 },
})
x:sheet("after_1_s", { rows = "stage", cols = "technique", at = "1s" })
x:sheet("after_20_s", { rows = "stage", cols = "technique", at = "20s" })
return x
