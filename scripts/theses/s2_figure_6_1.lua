-- scripts/theses/s2_figure_6_1.lua: a flash in a box.
--
--     lumbre run scripts/theses/s2_figure_6_1.lua              1 minute
--     lumbre run scripts/theses/s2_figure_6_1.lua quick=true   5 seconds
--     lumbre run scripts/theses/s2_figure_6_1.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.1: figure 6.1, the picture without time and frames,
-- in which the front of direct light comes first and those of light that was reflected follow. Here
-- two path edges are direct light alone, and six all of it.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_1", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("depth", { 2, 6 })
x:render(function(p)
  local render = s2.picture(p)
  render.max_depth = p.depth
  return render
end)
s2.measure(x)
x:frames("flash", { rows = "depth", at = { 0.5, 1, 1.6, 2, 3.4, 5 }, static = true })
return x
