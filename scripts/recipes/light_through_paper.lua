-- scripts/recipes/light_through_paper.lua: three techniques on a lamp whose light comes through its shade.

local x = experiment("light_through_paper", { seed = 12, repeats = 3 })

x:axis("technique", { "nee", "bdpt", "guided" })
x:axis("transmittance", { 0.1, 0.6 })
x:axis("size", { 96 })
x:axis("seconds", { 2 })
x:axis("reference", { 1024 })

x:render(function(p)
  return {
    scene = "scripts/recipes/scenes/paper_lamp.lua",
    scene_options = { transmittance = p.transmittance },
    integrator = p.technique,
    max_depth = 12,
    resolution = { p.size, p.size * 3 // 4 },
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(p.reference) end,
}

x:measure { every = "0.1s", rmse = metric.rmse(), relmse = metric.relmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = "relmse", by = "technique", facet = "transmittance" })
x:table("relmse", { value = "relmse", rows = "technique", cols = "transmittance" })

return x
