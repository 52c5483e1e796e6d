-- Antialiasing: pixel filters and their radii at edges of high contrast.
--
--     lumbre run scripts/antialiasing.lua
--
-- After section 4.4.2 of thesis S0 (docs/bibliography.md) and its figure 4.7, which compares a picture without antialiasing with one
-- whose rays are jittered by a Gaussian. Here are all filters, on a chart made for them: a star whose spokes become finer
-- than the pixels, bars that do, and a square with slanted edges.
--
-- Look at the pictures under out/: a box of radius 0 takes the pixel's centre alone, which makes staircases and rings in
-- the star that are not there. Wider filters trade them for blur. `antialiasing_radius` is the source's own Gaussian,
-- with a sigma of twice the radius and no end: its default of 0.3 is already softer than the pixel's square.
--
-- The error is measured against a reference with the same filter, so that it is noise alone and not blur: a wider filter
-- sees more contrast within one pixel, so it needs more samples.

local x = experiment("antialiasing", { seed = 442 })

-- Radii are in pixels; axes that move together are zipped.
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
    -- Sobol's paths go one by one, and so do the others, or times would compare that.
    accel = { lanes = "never" },
  }
end)

x:reference {
  from = function(p) return { sampler = "sobol" } end,
  stop = stop.samples(1024),
}

-- Radiance is what is on display: edges have the grey that covers them by half.
x:measure { every = "0.2s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 0 } }
x:stop(stop.samples(64))

x:figure("convergence", { x = "samples", y = "rmse", by = "sampler", facet = { "filter", "radius" } })
x:table("rmse", { value = "rmse", rows = { "filter", "radius" }, cols = "sampler" })

return x
