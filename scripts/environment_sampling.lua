-- scripts/environment_sampling.lua: noise under a sky with and without importance sampling.
--
--     lumbre run scripts/environment_sampling.lua
--
-- After thesis S1, section 4.1.2 and figure 4.1 (docs/bibliography.md): next event estimation that
-- samples directions towards an environment map uniformly, or in proportion to the luminance of its
-- texels. The sky has a small sun, which one of some thousand uniform directions meets.
--
-- Both have the same mean, so all cells share one reference. `mis = "none"` is the estimator of the
-- thesis at that point: light that paths hit by chance is not counted.
--
-- Results in out/latest:
--     runs/**/final.png       a picture of each
--     figures/convergence_*   RMSE against samples by sampling, for each heuristic
--     tables/rmse             RMSE after the same samples

local x = experiment("environment_sampling", { seed = 41 })

x:axis("mis", { "none", "power" })
x:axis("sampling", { "uniform", "luminance" })
x:axis("size", { 192 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    scene_options = { shape = "knot", light = "sky" },
    integrator = "nee",
    mis = p.mis,
    max_depth = 4,
    resolution = { p.size, p.size },
    set = { ["environment.sampling"] = p.sampling },
  }
end)

x:reference {
  from = function(p) return { mis = "power", set = { ["environment.sampling"] = "luminance" } } end,
  stop = function(p) return stop.samples(16 * p.samples) end,
}

x:measure { every = "0.2s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = "rmse", by = "sampling", facet = "mis" })
x:table("rmse", { value = "rmse", rows = "sampling", cols = "mis" })

return x
