-- scripts/bsdf_sampling.lua: noise of metals with and without importance sampling of their BSDF.
--
--     lumbre run scripts/bsdf_sampling.lua
--
-- After thesis S1, section 4.1.3 and figure 4.3 (docs/bibliography.md): paths that continue in
-- uniform directions over the hemisphere, or in those that the BSDF samples. The smoother a metal,
-- the rarer a uniform direction meets its lobe.
--
-- `directions` is a parameter of `bpt` and `nee`. Both values have the same mean, so they share a
-- reference. `bpt` finds all light by chance, so the difference is that of the directions alone.
--
-- Results in out/latest:
--     runs/**/final.png       a picture of each
--     figures/convergence_*   RMSE against samples by directions, for each roughness
--     tables/rmse             RMSE after the same samples

local x = experiment("bsdf_sampling", { seed = 43 })

x:axis("roughness", { 0.1, 0.3, 0.6, 1 })
x:axis("directions", { "uniform", "bsdf" })
x:axis("size", { 128 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    integrator = "bpt",
    directions = p.directions,
    max_depth = 4,
    resolution = { p.size, p.size },
    set = {
      ["materials.ball.metallic"] = 1,
      ["materials.ball.roughness"] = p.roughness,
      ["materials.ball.base_color"] = { 0.9, 0.7, 0.4 },
    },
  }
end)

x:reference {
  from = function(p) return { integrator = "nee" } end,
  stop = function(p) return stop.samples(4 * p.samples) end,
}

x:measure { every = "0.5s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = "rmse", by = "directions", facet = "roughness" })
x:table("rmse", { value = "rmse", rows = "roughness", cols = "directions" })

return x
