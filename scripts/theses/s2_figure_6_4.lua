-- scripts/theses/s2_figure_6_4.lua: a hare with an Epanechnikov delay.
--
--     lumbre run scripts/theses/s2_figure_6_4.lua              2 minutes
--     lumbre run scripts/theses/s2_figure_6_4.lua quick=true   10 seconds
--     lumbre run scripts/theses/s2_figure_6_4.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.2.1: figure 6.4, no delay, and (mu, sigma) of
-- (0.5, 0.1), (0.5, 0.5) and (0.1, 0.1).

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_4", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("profile", { "Cte(0)", "Epan(0.5, 0.1)", "Epan(0.5, 0.5)", "Epan(0.1, 0.1)" })
x:render(function(p)
  local mean, width = p.profile:match("Epan%((.*), (.*)%)")
  return s2.picture(p, mean and {
    delay = "epanechnikov", delay_mean = tonumber(mean), delay_width = tonumber(width),
  })
end)
s2.measure(x)
x:frames("delays", { rows = "profile", at = { 1, 1.5, 2, 3, 4 }, density = "hare", static = true })
return x
