-- scripts/first_light.lua: the first experiment to run, and an introduction to scripts.
--
--     lumbre run scripts/first_light.lua     half a minute on two cores
--
-- A script renders nothing itself: it describes an experiment and returns it. Lumbre makes a plan
-- of it (`lumbre plan scripts/first_light.lua` prints the plan), renders the runs that are missing,
-- measures their errors while it renders, and writes pictures, curves and tables to out/.
--
-- The question of this experiment: how do the maximum path depth and the radius of the pixel filter
-- change the noise of a path tracer, and the time that it takes?
--
-- Results in out/latest:
--     runs/**/final.png       a picture for each depth and radius
--     figures/convergence_*   RMSE and SSIM against render time by radius, for each depth
--     tables/rmse             final RMSE by depth and radius
--     tables/time             render time in seconds, in the same order

-- An experiment has a name, with which the name of its folder starts, and a seed, from which all
-- its random numbers are derived: the same seed gives the same pictures, bit for bit.
local x = experiment("first_light", { seed = 1 })

-- An axis is a parameter with its values. Every combination of values is one cell of the plan, here
-- 2 x 2 = 4.
--
-- depth is the maximum number of edges of a path from the camera to the light. 2 is direct light
-- alone: the shadows in the box are black. 6 adds indirect light, and the red and green walls
-- colour the white ones.
x:axis("depth", { 2, 6 })

-- radius is the distance in pixels at which the Gaussian pixel filter ends: 0.5 is sharp and shows
-- jagged edges, 1.5 is softer. Values are a list, or range(first, last, step), linspace or
-- logspace. Axes that vary together are zipped:
-- x:axis({ "depth", "radius" }, zip({ 2, 6 }, { 0.5, 1.5 })).
x:axis("radius", { 0.5, 1.5 })

-- Returns what one cell renders. p is a point of the sweep, with a field for every axis. Relative
-- file names are searched from the current folder first, then from the folder of this script.
x:render(function(p)
  return {
    scene = "scenes/cornell/cornell.scn",
    integrator = "bpt", -- path tracing: from the camera until a path meets the light
    max_depth = p.depth,
    resolution = { 128, 128 },
    aa = { filter = "gauss", radius = p.radius },
  }
end)

-- The reference that cells are measured against: the same picture with far more samples. It is
-- rendered first and kept in out/refs for later experiments. A function `from` could change what it
-- renders, for example to a better integrator: from = function(p) return { integrator = ".." } end.
-- `agree` renders it a second time with another technique and compares the two block by block: a
-- biased reference raises an alarm.
x:reference { stop = stop.samples(1024), agree = { with = "nee" } }

-- Metrics, measured at least every quarter of a second of render time. Each key is a column. RMSE
-- and relMSE compare radiance; SSIM compares displayed pictures, so it needs a tone map that
-- converts radiance to pixel values.
local display = tonemap.srgb { exposure = 0 }
x:measure {
  every = "0.25s",
  rmse = metric.rmse(),
  relmse = metric.relmse { eps = 0.01 },
  ssim = metric.ssim { on = display, range = 1 },
  display = display,
}

-- A cell ends at 128 samples per pixel or after ten seconds of render time (the time inside the
-- renderer), whichever comes first. Other rules: stop.when("ssim", ">", 0.95, { hold = 3 }),
-- stop.plateau("rmse"), stop.waves(n), stop.nan(n), stop.predicate(function(row, history) .. end);
-- stop.all and stop.not_ combine rules.
x:stop(stop.any { stop.samples(128), stop.time("10s") })

-- Error against render time: one curve per radius, one figure per depth. The axes are logarithmic.
-- The RMSE of independent samples is a straight line there: four times the samples halve it.
x:figure("convergence", { x = "render_s", y = { "rmse", "ssim" }, by = "radius", facet = "depth" })

-- The values at the end of each cell, as Markdown and CSV.
x:table("rmse", { value = "rmse", rows = "depth", cols = "radius" })
x:table("time", { value = "render_s", rows = "depth", cols = "radius" })

return x
