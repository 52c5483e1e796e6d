-- How strategies that find the same light should be weighted.
--
--     lumbre run scripts/mis_study.lua
--
-- Next event estimation and bidirectional path tracing find the same path in several ways. With mis = "power" each way
-- counts by the square of its density, with "balance" by the density itself [Veach 1997, ch. 9], and with "none" not by
-- densities at all: `nee` then leaves out light that a path meets by chance where a connection could have found it, as
-- the first source's program does (its section 4.10 names this as future work), and `bdpt` shares a path equally among
-- all strategies that can find it. Figures 4.13 and 4.14 of that source show its bidirectional strategies before and
-- after weighting; here is what the weighting is worth, as error over time.
--
-- The scene is a box with a mirror and a glass sphere: light that reaches the walls through them is found by `nee` only
-- by chance, and by `bdpt` from the light. So the choice of weights makes a great difference to `bdpt` here, and hardly
-- any to `nee`, whose noise is all in what no connection can find.

local x = experiment("mis_study", { seed = 7 })

x:axis("technique", { "nee", "bdpt" })
x:axis("mis", { "power", "balance", "none" })

x:render(function(p)
  return {
    scene = "scenes/cornell_spheres/cornell_spheres.scn",
    integrator = p.technique,
    mis = p.mis,
    max_depth = 7,
    resolution = { 96, 96 },
  }
end)

-- One reference for all: bidirectional, far longer than any cell.
x:reference {
  from = function()
    return { integrator = "bdpt", mis = "power" }
  end,
  stop = stop.samples(1024),
}

x:measure {
  every = "0.25s",
  rmse = metric.rmse(),
  relmse = metric.relmse { eps = 0.01 },
  display = tonemap.srgb { exposure = 0 },
}

x:stop(stop.any { stop.samples(128), stop.time("10s") })

x:figure("error_over_time", { x = "render_s", y = { "rmse", "relmse" }, by = "mis", facet = "technique" })

x:table("relmse", { value = "relmse", rows = "technique", cols = "mis" })
x:table("rmse", { value = "rmse", rows = "technique", cols = "mis" })
x:table("time", { value = "render_s", rows = "technique", cols = "mis" })

return x
