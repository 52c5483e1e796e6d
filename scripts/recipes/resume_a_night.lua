-- scripts/recipes/resume_a_night.lua: a night that may be interrupted at any time.

local x = experiment("resume_a_night", { seed = 14, repeats = 2 })

x:axis("depth", { 2, 4, 8 })
x:axis("technique", { "nee", "bdpt" })
x:axis("size", { 64 })
x:axis("samples", { 128 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = p.technique,
    max_depth = p.depth,
    resolution = { p.size, p.size },
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(4 * p.samples) end,
}

x:measure { every = "0.5s", rmse = metric.rmse() }
x:stop(function(p) return stop.samples(p.samples) end)

-- Save unfinished runs after every 5 s of render time; the default is 60 s.
x:checkpoint("5s")

x:table("rmse", { value = "rmse", rows = "depth", cols = "technique" })

return x
