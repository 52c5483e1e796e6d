-- scripts/theses/s0_figure_4_7.lua: antialiasing.
--
--     lumbre run scripts/theses/s0_figure_4_7.lua              20 seconds
--     lumbre run scripts/theses/s0_figure_4_7.lua quick=true   5 seconds
--
-- Thesis S0 (docs/bibliography.md), section 4.4.2: figure 4.7, a picture without antialiasing, and
-- one whose rays are offset by a Gaussian. `none` samples the centre of each pixel; `document` is
-- the Gaussian with the radius of the published program, a sigma of 0.3 pixels; `pixel` is uniform
-- over the pixel. The error is measured against the mean over each pixel.

local x = experiment("s0_figure_4_7", { seed = 2026, repeats = 5 })

local filters = {
  none = { filter = "box", radius = 0 },
  document = { filter = "antialiasing_radius", radius = 0.15 },
  pixel = { filter = "box", radius = 0.5 },
}
x:axis("quick", { false })
x:axis("aa", { "none", "document", "pixel" })

x:render(function(p)
  return {
    scene = "scenes/edges/edges.scn",
    integrator = "bpt",
    max_depth = 1,
    resolution = p.quick and { 96, 64 } or { 384, 256 },
    aa = filters[p.aa],
  }
end)
x:reference {
  from = function() return { aa = filters.pixel, sampler = "sobol" } end,
  stop = stop.samples(4096),
}
x:measure { every = "1s", rmse = metric.rmse(), display = tonemap.gamma { gamma = 2.2 } }
x:stop(stop.samples(256))
x:sheet("filters", { cols = "aa" })
x:table("rmse", { value = "rmse", rows = "aa" })
return x
