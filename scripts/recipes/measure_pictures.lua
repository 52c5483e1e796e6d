-- scripts/recipes/measure_pictures.lua: a noisy and a clean picture, to be measured as files.

local x = experiment("measure_pictures", { seed = 21 })

x:axis("samples", { 16, 1024 })
x:axis("size", { 96 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = "nee",
    max_depth = 5,
    resolution = { p.size, p.size },
  }
end)

x:measure { display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
