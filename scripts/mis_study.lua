-- scripts/mis_study.lua: how much the weights of multiple importance sampling (MIS) reduce the
-- error of next event estimation and bidirectional path tracing.
--
--     lumbre run scripts/mis_study.lua
--
-- Both techniques can find the same path by several strategies. mis = "power" weights a strategy by
-- the square of its density, "balance" by the density [Veach 1997, ch. 9], and "none" uses no
-- densities: `nee` then omits light that a path meets by chance where light sampling could have
-- found it, as the program of thesis S0 does, whose section 4.10 leaves MIS as future work, and
-- `bdpt` weights all strategies that can find a path equally. Thesis S0, figures 4.13 and 4.14
-- (docs/bibliography.md), shows its bidirectional strategies before and after weighting; this
-- script measures the gain as error over time.
--
-- The scene is a box with a mirror and a glass sphere. Light that reaches the walls through them is
-- found by `nee` only by chance, and by `bdpt` from the light. The weights therefore matter much
-- for `bdpt` and hardly for `nee`, whose noise comes from light that no connection can find.
--
-- Results in out/latest:
--     figures/error_over_time_*   RMSE and relMSE against render time by weights, per technique
--     tables/{relmse,rmse}        final error by technique and weights
--     tables/time                 render time in seconds, in the same order

local x = experiment("mis_study", { seed = 7, repeats = 3 })

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

-- One reference for all cells, by `bdpt` with at least eight times their samples.
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
