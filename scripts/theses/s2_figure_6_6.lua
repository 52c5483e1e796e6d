-- scripts/theses/s2_figure_6_6.lua: a hare of chlorophyll.
--
--     lumbre run scripts/theses/s2_figure_6_6.lua              2 minutes
--     lumbre run scripts/theses/s2_figure_6_6.lua quick=true   10 seconds
--     lumbre run scripts/theses/s2_figure_6_6.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.2.3: figure 6.6, green light without a delay and red
-- light after 1, with weights of 30 % and 70 % for green.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_6", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("green", { 0.3, 0.7 })
x:render(function(p) return s2.picture(p, { weights = { p.green, 1 - p.green } }, "chlorophyll", "hare") end)
s2.measure(x)
x:frames("chlorophyll", { rows = "green", at = { 1, 1.5, 2, 2.5, 3 }, density = "hare", static = true })
return x
