-- scripts/theses/s2_figure_6_2.lua: a hare with a constant delay.
--
--     lumbre run scripts/theses/s2_figure_6_2.lua              2 minutes
--     lumbre run scripts/theses/s2_figure_6_2.lua quick=true   10 seconds
--     lumbre run scripts/theses/s2_figure_6_2.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.2.1: figure 6.2, delays of 0, 1 and 2. The walls,
-- which have none, are lit at the same time in all rows.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_2", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("c", { 0, 1, 2 })
x:render(function(p) return s2.picture(p, { delay = "constant", delay_constant = p.c }) end)
s2.measure(x)
x:frames("delays", { rows = "c", at = { 1, 2, 3, 4, 5 }, density = "hare", static = true })
return x
