-- scripts/antialiasing.lua: pixel filters and their radii at edges of high contrast.
--
--     lumbre run scripts/antialiasing.lua
--
-- After thesis S0, section 4.4.2 and figure 4.7 (docs/bibliography.md), which compares a picture
-- without antialiasing with one whose rays are jittered by a Gaussian. This script renders every
-- filter on a test chart: a star and bars that become finer than the pixels, and a square with
-- slanted edges.
--
-- A box of radius 0 samples only the centre of a pixel, which causes staircases and false rings in
-- the star. Wider filters remove them and blur more. `antialiasing_radius` is the filter of thesis
-- S0: a Gaussian that is not truncated, with a sigma of twice the radius. The default radius of the
-- thesis, 0.3, already blurs more than the square of the pixel.
--
-- Each reference has the filter of its cell, so the error is noise and not blur. A wider filter
-- covers more contrast within one pixel and therefore needs more samples.
--
-- Results in out/latest:
--     runs/**/final.png       the chart with each filter
--     figures/convergence_*   RMSE against samples by sampler, for each filter and radius
--     tables/rmse             final RMSE by filter, radius and sampler

local x = experiment("antialiasing", { seed = 442 })

-- Radii in pixels: half the width of the filter, for `antialiasing_radius` half of sigma. Zipped
-- axes vary together.
x:axis({ "filter", "radius" }, zip(
  { "box", "box", "box", "tent", "tent", "gauss", "gauss", "blackman_harris", "blackman_harris",
    "antialiasing_radius", "antialiasing_radius" },
  { 0, 0.5, 1, 1, 2, 0.5, 1.5, 1.5, 2, 0.3, 1 }
))
x:axis("sampler", { "independent", "sobol" })

x:render(function(p)
  return {
    scene = "scenes/edges/edges.scn",
    integrator = "bpt",
    max_depth = 1,
    resolution = { 192, 128 },
    aa = { filter = p.filter, radius = p.radius },
    sampler = p.sampler,
  }
end)

x:reference {
  from = function(p) return { sampler = "sobol" } end,
  stop = stop.samples(1024),
}

-- Exposure 0 displays radiance as it is: a pixel that is half covered has radiance 0.5.
x:measure { every = "0.2s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 0 } }
x:stop(stop.samples(64))

x:figure("convergence", { x = "samples", y = "rmse", by = "sampler", facet = { "filter", "radius" } })
x:table("rmse", { value = "rmse", rows = { "filter", "radius" }, cols = "sampler" })

return x
