-- scripts/recipes/compare_nights.lua: one night, to be run twice and compared.

local x = experiment("compare_nights", { seed = 20, repeats = 3 })

x:axis("technique", { "nee", "bdpt" })
x:axis("size", { 64 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = p.technique,
    max_depth = 5,
    resolution = { p.size, p.size },
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(16 * p.samples) end,
}

x:measure { every = "0.1s", rmse = metric.rmse() }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("rmse", { value = "rmse", rows = "technique" })

return x
