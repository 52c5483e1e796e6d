-- scripts/recipes/time_to_quality.lua: how long does each technique take to a given error?

local x = experiment("time_to_quality", { seed = 6, repeats = 3 })

x:axis("technique", { "bpt", "nee", "bdpt" })
x:axis("size", { 64 })
x:axis("seconds", { 10 })
x:axis("reference", { 2048 })

local goal = 0.02 -- relMSE

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
  stop = function(p) return stop.samples(p.reference) end,
}

-- `every` is the resolution in time of the answer.
x:measure { every = "0.05s", relmse = metric.relmse() }

-- A run ends after two measurements in a row below the goal, or when its time is over.
x:stop(function(p)
  return stop.any { stop.when("relmse", "<", goal, { hold = 2 }), stop.time(p.seconds) }
end)

x:figure("convergence", { x = "render_s", y = "relmse", by = "technique" })
x:table("seconds", { value = time_to("relmse", goal), rows = "technique" })

return x
