-- First light: the first experiment to run, and a tour of what a script can say.
--
--     lumbre run scripts/first_light.lua
--
-- A script renders nothing itself. It describes an experiment and returns it; Lumbre then makes a plan of it
-- (`lumbre plan scripts/first_light.lua` shows the plan), renders what is not there yet, measures the error while it
-- renders, and leaves pictures, curves and tables under out/.
--
-- The question of this experiment: how do the length of the light's paths and the width of the pixel filter change
-- the noise of a path tracer, and the time it takes?

-- An experiment has a name, which becomes a folder's, and a seed, from which all its random numbers follow: the same
-- seed gives the same pictures, bit for bit.
local x = experiment("first_light", { seed = 1 })

-- Axes are what is varied; every combination is one cell of the plan, here 2 x 2 = 4.
--
-- depth counts the edges of a path from the camera to the light. 2 is direct light alone: the shadows in the box are
-- black. 6 lets light bounce around, and the red and green walls colour the white ones.
x:axis("depth", { 2, 6 })

-- radius is where the Gaussian pixel filter ends, in pixels: 0.5 is sharp and shows jagged edges, 1.5 is softer.
-- Besides lists there are range(first, last, step), linspace and logspace; axes that move together are written
-- x:axis({ "depth", "radius" }, zip({ 2, 6 }, { 0.5, 1.5 })).
x:axis("radius", { 0.5, 1.5 })

-- What one cell renders. p is a point of the sweep: it has a field for every axis. Files are looked for from the
-- folder where lumbre was started, then from this script's.
x:render(function(p)
  return {
    scene = "scenes/cornell/cornell.scn",
    integrator = "bpt", -- backward path tracing: from the camera until a path meets the light
    max_depth = p.depth,
    resolution = { 128, 128 },
    aa = { filter = "gauss", radius = p.radius },
  }
end)

-- The truth that the cells are measured against: the same picture with far more samples, rendered first and kept
-- under out/refs, so that the next run finds it there. A function `from` could change what it renders, for example
-- to a better integrator: from = function(p) return { integrator = ".." } end.
x:reference { stop = stop.samples(1024) }

-- What is measured, at least every quarter of a second of rendering. Each key is a column and holds a metric.
-- RMSE and relMSE compare radiance itself; SSIM compares pictures as they are seen, so it needs a tone map
-- that converts radiance to pixel values.
local display = tonemap.srgb { exposure = 0 }
x:measure {
  every = "0.25s",
  rmse = metric.rmse(),
  relmse = metric.relmse { eps = 0.01 },
  ssim = metric.ssim { on = display, range = 1 },
  display = display,
}

-- A cell is finished when every pixel has 128 samples, or after ten seconds, whichever comes first. Only the time
-- inside the renderer counts. Other rules: stop.when("ssim", ">", 0.95, { hold = 3 }), stop.plateau("rmse"),
-- stop.waves(n), stop.nan(n), stop.predicate(function(row, history) .. end), and stop.all and stop.not_ to combine them.
x:stop(stop.any { stop.samples(128), stop.time("10s") })

-- How the error falls: one curve for each filter radius, one picture for each depth. On logarithmic axes the error
-- of independent samples is a line that falls by half whenever the samples are four times as many.
x:figure("convergence", { x = "render_s", y = { "rmse", "ssim" }, by = "radius", facet = "depth" })

-- The numbers at the end, as Markdown and CSV.
x:table("rmse", { value = "rmse", rows = "depth", cols = "radius" })
x:table("time", { value = "render_s", rows = "depth", cols = "radius" })

return x
