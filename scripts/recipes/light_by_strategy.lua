-- scripts/recipes/light_by_strategy.lua: what each strategy of `bdpt` finds (Veach's pyramid).

local x = experiment("light_by_strategy", { seed = 10 })

x:axis("mis", { "power" })
x:axis("size", { 96 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/veach_lamps.lua",
    integrator = "bdpt",
    mis = p.mis,
    max_depth = 5,
    resolution = { p.size, p.size * 9 // 16 },
    films = { "strategies" },
  }
end)

x:measure { display = tonemap.srgb { exposure = 1 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
