-- scripts/recipes/own_model.lua: a glTF model on a ground, in two lights.

local x = experiment("own_model", { seed = 17 })

x:axis("light", { "studio", "sky" })
x:axis("size", { 128 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scripts/recipes/scenes/pawn.lua",
    scene_options = { light = p.light },
    integrator = "nee",
    resolution = { p.size, p.size },
  }
end)

x:measure { display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
