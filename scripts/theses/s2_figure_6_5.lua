-- scripts/theses/s2_figure_6_5.lua: a hare whose delay is a texture.
--
--     lumbre run scripts/theses/s2_figure_6_5.lua              2 minutes
--     lumbre run scripts/theses/s2_figure_6_5.lua quick=true   10 seconds
--     lumbre run scripts/theses/s2_figure_6_5.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.2.2: figure 6.5, white patches with a delay of 1 and
-- black ones without, which the picture without time does not show. Beside it: the hare without
-- patches, all early and all late.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_5", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("hare", { "early", "patches", "late" })
x:render(function(p)
  if p.hare == "patches" then return s2.picture(p, { texture_filter = "nearest" }, "patches", "hare") end
  return s2.picture(p, { delay = "constant", delay_constant = p.hare == "late" and 1 or 0 }, "plain", "hare")
end)
x:reference {
  from = function(p)
    local plain = { delay = "none", delay_constant = 0, texture_filter = "given" }
    return s2.picture(p, plain, "plain", "hare")
  end,
  stop = function(p) return stop.samples(p.quick and 512 or 8192) end,
}
x:measure { every = "5s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.quick and 128 or 1024) end)
x:frames("patches", { rows = "hare", at = { 1, 1.5, 2, 2.5, 3 }, static = true })
return x
