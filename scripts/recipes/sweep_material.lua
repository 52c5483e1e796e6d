-- scripts/recipes/sweep_material.lua: one parameter of one material.

local x = experiment("sweep_material", { seed = 8 })

x:axis("roughness", linspace(0, 1, 5))
x:axis("size", { 64 })
x:axis("samples", { 16 })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    integrator = "nee",
    resolution = { p.size, p.size },
    set = {
      ["materials.ball.roughness"] = p.roughness,
      ["materials.ball.metallic"] = 1,
      ["materials.ball.base_color"] = { 1.0, 0.76, 0.46 },
    },
  }
end)

x:reference { stop = function(p) return stop.samples(16 * p.samples) end }

x:measure { every = "10s", relmse = metric.relmse() }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("noise", { x = "roughness", y = "relmse" })
x:table("relmse", { value = "relmse", rows = "roughness" })
x:sheet("pictures", { cols = "roughness" })

return x
