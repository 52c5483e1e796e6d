-- scripts/recipes/guided_paths.lua: path tracing with and without guiding in a room lit through a door ajar.

local x = experiment("guided_paths", { seed = 31, repeats = 3 })

x:axis("technique", { "nee", "guided", "bdpt" })
x:axis("size", { 128 })
x:axis("seconds", { 8 })
x:axis("reference", { 4096 })

x:render(function(p)
  return {
    scene = "scenes/door_ajar.lua",
    view = "room",
    integrator = p.technique,
    max_depth = 8,
    resolution = { p.size, p.size * 9 // 16 },
  }
end)

-- Guiding is unbiased, and its samples have less noise than those of nee here.
x:reference {
  from = function() return { integrator = "guided", training = 1024 } end,
  stop = function(p) return stop.samples(p.reference) end,
}

x:measure { every = "0.25s", rmse = metric.rmse(), relmse = metric.relmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = { "rmse", "relmse" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("relmse", { value = "relmse", rows = "technique" })

return x
