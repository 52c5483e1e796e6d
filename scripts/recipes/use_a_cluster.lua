-- scripts/recipes/use_a_cluster.lua: a night for many workers.

local x = experiment("use_a_cluster", { seed = 15, repeats = 4 })

x:axis("inside", { "blocks", "spheres" })
x:axis("technique", { "nee", "bdpt" })
x:axis("size", { 64 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    scene_options = { inside = p.inside },
    integrator = p.technique,
    max_depth = 6,
    resolution = { p.size, p.size },
    -- Name the backend: the login node may have no GPU where the nodes have one.
    backend = "cpu",
  }
end)

-- Long references are divided, so that several workers can render one of them.
x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(8 * p.samples) end,
  parts = 4,
}

x:measure { every = "1s", rmse = metric.rmse() }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("rmse", { value = "rmse", rows = "inside", cols = "technique" })

return x
