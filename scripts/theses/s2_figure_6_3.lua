-- scripts/theses/s2_figure_6_3.lua: a hare with an exponential delay.
--
--     lumbre run scripts/theses/s2_figure_6_3.lua              2 minutes
--     lumbre run scripts/theses/s2_figure_6_3.lua quick=true   10 seconds
--     lumbre run scripts/theses/s2_figure_6_3.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.2.1: figure 6.3, no delay, and rates of 2 and 0.5.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_3", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("profile", { "Cte(0)", "Exp(2)", "Exp(0.5)" })
local rates = { ["Exp(2)"] = 2, ["Exp(0.5)"] = 0.5 }
x:render(function(p)
  local rate = rates[p.profile]
  return s2.picture(p, rate and { delay = "exponential", delay_rate = rate })
end)
s2.measure(x)
x:frames("delays", { rows = "profile", at = { 1, 2, 3, 4, 5 }, density = "hare", static = true })
return x
