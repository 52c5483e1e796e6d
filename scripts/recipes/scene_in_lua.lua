-- scripts/recipes/scene_in_lua.lua: every view of a scene that is written in Lua.

local x = experiment("scene_in_lua", { seed = 18 })

x:axis("view", { "front", "above" })
x:axis("columns", { 3, 6 })
x:axis("size", { 128 })
x:axis("samples", { 32 })

x:render(function(p)
  return {
    scene = "scripts/recipes/scenes/pavilion.lua",
    view = p.view,
    scene_options = { columns = p.columns, light = "sun" },
    integrator = "nee",
    resolution = { p.size, p.size * 9 // 16 },
  }
end)

x:measure { display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
