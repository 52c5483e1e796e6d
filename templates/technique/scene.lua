-- scene.lua: a room with a lamp, a matt and a glossy ball, and one of glass.

local s = scene { resolution = { 256, 256 }, max_depth = 5 }

s:camera { position = { 0, 0, 3.4 }, target = { 0, 0, 0 }, fov = 40 }

s:material("white", { model = "lambert", base_color = { 0.7, 0.7, 0.7 } })
s:material("red", { model = "lambert", base_color = { 0.7, 0.2, 0.1 } })
s:material("metal", { base_color = { 0.9, 0.8, 0.6 }, metallic = 1, roughness = 0.3 })
s:material("glass", { opacity = 0, roughness = 0, ior = 1.5 })
s:material("lamp", { emission = { 20, 18, 15 }, emitter_reflects = false })

-- The walls of a room without a front, each a square of side 2 that lies at y = -1 and is turned.
local function wall(name, material, turn)
  s:add { name = name, shape = shape.grid { size = { 2, 2 } }, material = material, at = turn.at, rotate = turn.rotate }
end
wall("floor", "white", { at = { 0, -1, 0 } })
wall("ceiling", "white", { at = { 0, 1, 0 }, rotate = { 180, 0, 0 } })
wall("back", "white", { at = { 0, 0, -1 }, rotate = { 90, 0, 0 } })
wall("left", "red", { at = { -1, 0, 0 }, rotate = { 0, 0, -90 } })
wall("right", "white", { at = { 1, 0, 0 }, rotate = { 0, 0, 90 } })

s:add {
  name = "lamp", shape = shape.grid { size = { 0.5, 0.5 } }, material = "lamp",
  at = { 0, 0.99, 0 }, rotate = { 180, 0, 0 },
}
s:add { name = "matt", shape = shape.sphere { radius = 0.35 }, material = "white", at = { -0.5, -0.65, -0.3 } }
s:add { name = "metal", shape = shape.sphere { radius = 0.35 }, material = "metal", at = { 0.45, -0.65, -0.45 } }
s:add { name = "glass", shape = shape.sphere { radius = 0.25 }, material = "glass", at = { 0.1, -0.75, 0.35 } }

return s
