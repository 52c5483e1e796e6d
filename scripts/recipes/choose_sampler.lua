-- scripts/recipes/choose_sampler.lua: independent random numbers against two kinds of Sobol sequences.

local x = experiment("choose_sampler", { seed = 11, repeats = 3 })

x:axis("depth", { 2, 6 })
x:axis("sampler", { "independent", "sobol", "zsobol16" })
x:axis("size", { 64 })
x:axis("samples", { 16 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = "nee",
    max_depth = p.depth,
    resolution = { p.size, p.size },
    sampler = p.sampler,
  }
end)

x:reference {
  from = function() return { integrator = "bdpt", sampler = "independent" } end,
  stop = function(p) return stop.samples(64 * p.samples) end,
}

x:measure { every = "10s", rmse = metric.rmse(), flip = metric.flip { on = tonemap.srgb() } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = "rmse", by = "sampler", facet = "depth" })
x:table("rmse", { value = "rmse", rows = "depth", cols = "sampler" })
x:table("flip", { value = "flip", rows = "depth", cols = "sampler" })
x:table("seconds", { value = "render_s", rows = "depth", cols = "sampler" })

return x
