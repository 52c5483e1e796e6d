-- scripts/theses/s0_figure_5_7.lua: convergence with longer paths.
--
--     lumbre run scripts/theses/s0_figure_5_7.lua              60 minutes
--     lumbre run scripts/theses/s0_figure_5_7.lua quick=true   4 minutes
--     lumbre run scripts/theses/s0_figure_5_7.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 5.3.1: figure 5.7, SSIM over time for each maximum
-- depth; in the room of the lamps and the court with 5, 6 and 7 path edges, in the gallery with 10
-- as well. The document: 1280x720, two graphics cards. Here: fewer pixels for two cores, a
-- reference for each depth.

local s0 = require("lib.s0")
local x = experiment("s0_figure_5_7", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("stage", { "veach-lamps", "atrium-sky", "gallery-sky" })
x:axis("depth", { 5, 6, 7, 10 })
x:axis("technique", { "bpt", "nee", "bdpt" })
x:skip("the document has this depth in the gallery only", function(p)
  return p.depth == 10 and p.stage ~= "gallery-sky"
end)

x:render(function(p)
  return s0.picture(p, p.technique, s0.form(p, { { 320, 180 }, { 80, 45 } }), p.depth)
end)
x:reference {
  from = function(p) return s0.stages[p.stage].reference end,
  stop = function(p) return stop.time(s0.form(p, { 150, 8 })) end,
}
x:measure {
  every = "0.25s",
  rmse = metric.rmse(),
  ssim = metric.ssim { on = s0.display },
  display = s0.display,
}
x:stop(function(p) return stop.time(s0.form(p, { 15, 1 })) end)
x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "depth", facet = { "stage", "technique" } })
x:table("ssim", { value = "ssim", rows = { "stage", "depth" }, cols = "technique" })
return x
