-- scripts/recipes/light_by_depth.lua: a picture for each path length, and a map of bounces.

local x = experiment("light_by_depth", { seed = 9 })

x:axis("size", { 128 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = "bdpt",
    max_depth = 6,
    resolution = { p.size, p.size },
    films = { "depth", "bounces" },
  }
end)

x:measure { display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
