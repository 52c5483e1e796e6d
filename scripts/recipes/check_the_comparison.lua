-- scripts/recipes/check_the_comparison.lua: how large is a difference that means nothing?

local x = experiment("check_the_comparison", { seed = 5, repeats = 4 })

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
  stop = function(p) return stop.samples(32 * p.samples) end,
}

x:measure { every = "10s", rmse = metric.rmse() }
x:stop(function(p) return stop.samples(p.samples) end)

-- Renders the first technique of every picture a second time with other seeds, and compares the two.
x:control()

x:table("rmse", { value = "rmse", rows = "technique" })
x:table("seconds", { value = "render_s", rows = "technique" })

return x
