-- scripts/recipes/scenes/pawn.lua: a glTF model with a ground, lights and a camera around it.

local s = scene { resolution = { 512, 512 }, max_depth = 6 }
local light = s:option("light", { "studio", "sky" })

-- This material replaces the one of the same name in the file.
s:material("wood", { base_color = { 0.45, 0.2, 0.08 }, roughness = 0.35 })
s:material("paper", { base_color = { 0.7, 0.7, 0.7 }, roughness = 1 })
s:material("softbox", { emission = { 14, 13, 12 } })

-- The file's unit is a centimetre and its pawn is 5 cm high: scaled to 1 unit, standing on y = 0.
s:import("../models/pawn.gltf", { place = { scale = 0.2 } })
s:add { name = "ground", shape = shape.grid { size = { 20, 20 } }, material = "paper" }

if light == "studio" then
  -- A rectangle emits on its front: +y, turned here to face down and a little to the side.
  s:add {
    name = "softbox",
    shape = shape.grid { size = { 1.2, 1.2 } },
    material = "softbox",
    at = { 1.2, 2.2, 0.8 },
    rotate = { 180, 0, 25 },
  }
  s:environment { color = { 0.05, 0.05, 0.06 } }
else
  s:environment { color = { 0.25, 0.33, 0.5 } }
  s:light { name = "sun", direction = { -0.6, -1, -0.5 }, irradiance = { 1.5, 1.35, 1.1 } }
end

-- The camera looks at half the height of the model.
s:camera { position = { 1.4, 0.9, 2.4 }, target = { 0, 0.5, 0 }, fov = 28 }

return s
