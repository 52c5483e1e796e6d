-- scripts/recipes/equal_time.lua: three techniques, the same render time for each.

local x = experiment("equal_time", { seed = 2, repeats = 3 })

x:axis("technique", { "bpt", "nee", "bdpt" })
x:axis("size", { 96 })
x:axis("seconds", { 1 })
x:axis("reference", { 512 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    scene_options = { inside = "spheres" },
    integrator = p.technique,
    max_depth = 6,
    resolution = { p.size, p.size },
  }
end)

-- One reference for all techniques.
x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(p.reference) end,
}

x:measure { every = "0.1s", rmse = metric.rmse(), relmse = metric.relmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = { "rmse", "relmse" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("samples", { value = "samples", rows = "technique" })

return x
