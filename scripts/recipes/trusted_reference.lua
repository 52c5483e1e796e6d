-- scripts/recipes/trusted_reference.lua: a reference with a known noise, checked by a second technique.

local x = experiment("trusted_reference", { seed = 13 })

x:axis("technique", { "nee", "bdpt" })
x:axis("size", { 96 })
x:axis("samples", { 256 })
x:axis("reference", { 1024 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    scene_options = { inside = "spheres" },
    integrator = p.technique,
    max_depth = 6,
    resolution = { p.size, p.size },
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(p.reference) end,
  -- Four ranges of samples, which several workers can render at once.
  parts = 4,
  -- `nee` renders the same picture with as many samples; a contradiction is exit code 6.
  agree = { with = "nee" },
}

x:measure { every = "0.5s", rmse = metric.rmse(), mse = metric.mse() }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = "rmse", by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })

return x
