-- scripts/theses/s0_figure_4_8.lua: points on triangles of different area.
--
--     lumbre run scripts/theses/s0_figure_4_8.lua              1 minute
--     lumbre run scripts/theses/s0_figure_4_8.lua quick=true   5 seconds
--
-- Thesis S0 (docs/bibliography.md), section 4.6: figure 4.8, a hundred points on two triangles, as
-- many on each, or in proportion to their area. The document draws the points; here a lamp of a
-- large and a small triangle of the same radiance lights a floor, and the error after the same
-- samples shows what the points are for. The document's program then takes all triangles alike.

local x = experiment("s0_figure_4_8", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("select", { "uniform", "area" })

x:render(function(p)
  return {
    scene = "scripts/theses/scenes/two_triangles.lua",
    integrator = "nee",
    mis = "none",
    select = p.select,
    max_depth = 2,
    resolution = p.quick and { 64, 36 } or { 256, 144 },
  }
end)
x:reference { from = function() return { select = "area", sampler = "sobol" } end, stop = stop.samples(4096) }
x:measure { every = "1s", rmse = metric.rmse(), display = tonemap.gamma { gamma = 2.2 } }
x:stop(stop.samples(256))
x:sheet("selection", { cols = "select" })
x:table("rmse", { value = "rmse", rows = "select" })
return x
