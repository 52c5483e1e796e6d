-- scripts/recipes/caustics_with_photons.lua: photon mapping and path tracing, alone and together, the same time for each.

local x = experiment("caustics_with_photons", { seed = 21, repeats = 3 })

x:axis("technique", { "nee", "bdpt", "sppm", "vcm" })
x:axis("size", { 96 })
x:axis("seconds", { 2 })
x:axis("reference", { 1024 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    scene_options = { inside = "spheres" },
    integrator = p.technique,
    max_depth = 8,
    resolution = { p.size, p.size },
  }
end)

-- `sppm` and `vcm` are biased, so the reference is by an unbiased technique.
x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(p.reference) end,
}

x:measure { every = "0.1s", rmse = metric.rmse(), relmse = metric.relmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = { "rmse", "relmse" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("relmse", { value = "relmse", rows = "technique" })

return x
