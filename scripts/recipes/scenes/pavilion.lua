-- scripts/recipes/scenes/pavilion.lua: a round roof on columns, with options and views.

local s = scene { resolution = { 640, 360 }, max_depth = 5 }
local columns = s:option("columns", { 6, 3, 12 }) -- the default is the first
local light = s:option("light", { "sun", "lamp" })

s:view("front", { position = { 0, 1.6, 7 }, target = { 0, 1.2, 0 }, fov = 40 })
s:view("above", { position = { 4, 6, 5 }, target = { 0, 1, 0 }, fov = 36 })

s:material("stone", { base_color = { 0.7, 0.66, 0.58 }, roughness = 0.9 })
s:material("tiles", { base_color = { 0.5, 0.18, 0.1 }, roughness = 0.6 })
s:material("lamp", { emission = { 30, 26, 20 } })

local column = shape.cylinder { radius = 0.14, height = 2, top = 0.11, segments = 24 }
for i = 1, columns do
  local angle = 2 * math.pi * i / columns
  s:add {
    name = "column_" .. i,
    shape = column,
    material = "stone",
    at = { 1.5 * math.sin(angle), 0, 1.5 * math.cos(angle) },
  }
end
s:add {
  name = "roof",
  shape = shape.lathe { profile = { { 1.8, 2 }, { 1.8, 2.15 }, { 0, 3 } } },
  material = "tiles",
}
s:add { name = "ground", shape = shape.grid { size = { 30, 30 } }, material = "stone" }

if light == "sun" then
  s:light { name = "sun", direction = { -1, -1.2, -0.7 }, irradiance = { 1.8, 1.7, 1.5 } }
  s:environment { color = { 0.15, 0.25, 0.45 } }
else
  s:add { name = "lamp", shape = shape.sphere { radius = 0.12 }, material = "lamp", at = { 0, 1.7, 0 } }
end

return s
