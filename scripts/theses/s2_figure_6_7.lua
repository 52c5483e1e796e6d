-- scripts/theses/s2_figure_6_7.lua: two colours, each with a delay from a texture.
--
--     lumbre run scripts/theses/s2_figure_6_7.lua              2 minutes
--     lumbre run scripts/theses/s2_figure_6_7.lua quick=true   5 seconds
--     lumbre run scripts/theses/s2_figure_6_7.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.2.3: figure 6.7, blue and then yellow from black
-- patches, and the same later from white ones. Textures are not filtered: between two patches a
-- filtered texture would have delays that neither has.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_7", { seed = 2026, repeats = 5 })

s2.axes(x)
x:render(function(p)
  local render = s2.picture(p, nil, "complex", "hare")
  render.set = {
    ["materials.hare_blue.texture_filter"] = "nearest",
    ["materials.hare_yellow.texture_filter"] = "nearest",
  }
  return render
end)
s2.measure(x)
x:frames("steps", { at = { 1.2, 2.2, 3.2, 4.2 }, static = true })
return x
