-- scripts/recipes/equal_samples.lua: three ways to weight strategies, the same samples for each.

local x = experiment("equal_samples", { seed = 3, repeats = 3 })

x:axis("mis", { "power", "balance", "none" })
x:axis("size", { 80 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/veach_mis.lua",
    integrator = "bdpt",
    mis = p.mis,
    max_depth = 3,
    resolution = { p.size, p.size * 9 // 16 },
  }
end)

x:reference {
  from = function() return { mis = "power" } end,
  stop = function(p) return stop.samples(16 * p.samples) end,
}

x:measure { every = "10s", rmse = metric.rmse(), relmse = metric.relmse() }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = "rmse", by = "mis" })
x:table("rmse", { value = "rmse", rows = "mis" })
x:table("seconds", { value = "render_s", rows = "mis" })

return x
