-- scripts/theses/s0_figure_5_6.lua: pictures of the room of the lamps with longer paths.
--
--     lumbre run scripts/theses/s0_figure_5_6.lua              5 minutes
--     lumbre run scripts/theses/s0_figure_5_6.lua quick=true   20 seconds
--     lumbre run scripts/theses/s0_figure_5_6.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 5.3.1: figure 5.6, the room with at most 5, 7 and 10
-- path edges, by bpt in an hour at 1280x720. Here `bdpt` renders it, which needs less time for the
-- same light.

local s0 = require("lib.s0")
local x = experiment("s0_figure_5_6", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("stage", { "veach-lamps" })
x:axis("depth", { 5, 7, 10 })

x:render(function(p) return s0.picture(p, "bdpt", s0.form(p, { { 320, 180 }, { 96, 54 } }), p.depth) end)
x:measure { every = "1s", display = s0.display }
x:stop(function(p) return stop.time(s0.form(p, { 20, 1 })) end)
x:sheet("depths", { cols = "depth" })
return x
