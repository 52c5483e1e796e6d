-- scripts/theses/s1_section_4_1_1.lua: next event estimation and the size of a lamp.
--
--     lumbre run scripts/theses/s1_section_4_1_1.lua              5 minutes
--     lumbre run scripts/theses/s1_section_4_1_1.lua quick=true   30 seconds
--
-- Thesis S1 (docs/bibliography.md), section 4.1.1, states that paths rarely meet a small light and
-- never a point, and that next event estimation finds both. No figure of the document shows it. The
-- lamp keeps its power as its radius falls.

local x = experiment("s1_section_4_1_1", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("technique", { "bpt", "nee" })
x:axis("lamp", { 0.2, 0.1, 0.05, 0.025 })

x:render(function(p)
  return {
    scene = "scenes/still_life.lua",
    scene_options = { lamp = p.lamp },
    integrator = p.technique,
    max_depth = 3,
    resolution = p.quick and { 64, 64 } or { 192, 192 },
  }
end)
x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(p.quick and 1024 or 4096) end,
}
x:measure { every = "10s", rmse = metric.rmse(), display = tonemap.srgb() }
x:stop(function(p) return stop.samples(p.quick and 64 or 256) end)
x:figure("rmse", { x = "lamp", y = "rmse", by = "technique" })
x:sheet("pictures", { rows = "technique", cols = "lamp" })
return x
