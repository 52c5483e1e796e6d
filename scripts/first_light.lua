-- scripts/first_light.lua: the first experiment to run, and an introduction to scripts.
--
--     lumbre run scripts/first_light.lua     under a minute on two cores
--
-- A script renders nothing itself: it describes an experiment and returns it. Lumbre makes a plan
-- of it (`lumbre plan scripts/first_light.lua` prints the plan), renders the runs that are missing,
-- measures their errors while it renders, and writes pictures, curves and tables to out/.
--
-- The question of this experiment: which of three techniques is better where glass and metal focus
-- the light of a small lamp?
--
-- Results in out/latest:
--     runs/**/final.png       a picture for each technique and repeat
--     figures/convergence     error against render time, a curve for each technique
--     tables/relmse           error of each technique after the same time

-- An experiment has a name, with which the name of its folder starts, and a seed, from which all
-- its random numbers are derived. Each technique renders the picture five times, with other random numbers,
-- because a single picture is luck. The techniques take turns of half a second, so that a machine that
-- slows down slows all of them.
local x = experiment("first_light", { seed = 1, repeats = 5 })

-- An axis is a parameter with its values. Every combination of values is one cell of the plan, here
-- three:
--   nee     paths from the camera, which choose a point on the lamp at each surface
--   bdpt    paths from the camera and from the lamp, connected in all ways
--   vcm     the same, and paths that meet at nearby points are merged
-- Values are a list, or range(first, last, step), linspace or logspace.
x:axis("technique", { "nee", "bdpt", "vcm" })

-- Axes with one value are settings that the command line can replace: `seconds=10`.
x:axis("seconds", { 1.5 })

-- Returns what one cell renders. p is a point of the sweep, with a field for every axis. Relative
-- file names are searched from the current folder first, then from the folder of this script.
x:render(function(p)
  return {
    scene = "scenes/still_life.lua",
    integrator = p.technique,
    max_depth = 6, -- edges of a path, at most
    resolution = { 256, 256 },
  }
end)

-- The reference that cells are measured against: the same picture with far more samples. It is
-- rendered first and kept in out/refs for later experiments. Its technique must be unbiased; `vcm` is
-- not, since it merges paths that do not quite meet.
x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.time(16 * p.seconds) end,
}

-- Metrics, measured at least every quarter of a second of render time. Each key is a column. This one
-- is the mean of squared errors relative to the radiance, without the worst thousandth of the pixels:
-- a few of them, lit by a rare path, would outweigh all others.
x:measure { every = "0.25s", relmse = metric.relmse_trimmed(), display = tonemap.srgb() }

-- A cell ends after the same render time, the time inside the renderer. Other rules: stop.samples(128),
-- stop.when("relmse", "<", 0.01), stop.plateau("relmse"); stop.any and stop.all combine rules.
x:stop(function(p) return stop.time(p.seconds) end)

-- Error against render time on logarithmic axes, where the error of independent samples is a straight
-- line: four times the samples halve a root mean square.
x:figure("convergence", { x = "render_s", y = "relmse", by = "technique" })

-- The error at the end of each cell, as Markdown and CSV.
x:table("relmse", { value = "relmse", rows = "technique" })

return x
