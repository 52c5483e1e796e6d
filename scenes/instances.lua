-- A tray of small vases, all instances of one mesh: the cost of instancing.
--
-- Option `count`, the number of vases (a square number is a full tray). The scene description
-- always stores the mesh once. The renderer does so in scenes of more than 2^20 triangles, here
-- from about 1,300 vases on, in a two-level acceleration structure. In a render table,
-- `accel = { instances = "always" }` or `"never"` decides this for any count.

local s = scene { resolution = { 960, 540 }, max_depth = 5 }
local count = s:option("count", 400)

s:view("tray", { position = { 0, 9, 15 }, target = { 0, -0.4, 0.4 }, fov = 42 })
s:view("among", { position = { 0.4, 1.5, 10 }, target = { 0, 0.2, 4 }, fov = 40 })

s:material("tray", { base_color = { 0.35, 0.33, 0.3 }, roughness = 0.6 })
local glazes = { { 0.75, 0.78, 0.8 }, { 0.15, 0.35, 0.55 }, { 0.55, 0.2, 0.12 }, { 0.3, 0.42, 0.22 }, { 0.8, 0.62, 0.25 } }
for i, color in ipairs(glazes) do
  s:material("glaze_" .. i, { base_color = color, roughness = 0.35, clearcoat = 1 })
end
s:material("sky", { emission = { 7, 7, 7.6 }, base_color = { 0, 0, 0 } })

s:add { name = "tray", shape = shape.box { size = { 17, 0.4, 17 }, bevel = 0.1 }, material = "tray", at = { 0, -0.2, 0 } }
s:add { name = "lamp", shape = shape.grid { size = { 7, 7 } }, material = "sky", at = { -5, 11, 2 }, rotate = { 180, 0, 24 } }
s:environment { color = { 0.3, 0.34, 0.4 } }

local vase = shape.lathe { segments = 32, profile = {
  { 0, 0 }, { 0.2, 0 }, { 0.22, 0.03 }, { 0.31, 0.25 }, { 0.34, 0.42 }, { 0.3, 0.6 }, { 0.18, 0.76 }, { 0.14, 0.86 },
  { 0.2, 0.97 }, { 0.17, 0.97 }, { 0.11, 0.86 }, { 0.15, 0.75 }, { 0.26, 0.58 }, { 0.29, 0.4 }, { 0, 0.08 } } }

local side = math.ceil(math.sqrt(count))
local step = 16 / side
local r = random(21)
for i = 0, count - 1 do
  local x, z = (i % side + 0.5) * step - 8, (i // side + 0.5) * step - 8
  s:add {
    name = "vase_" .. (i + 1),
    shape = vase,
    material = "glaze_" .. r:integer(1, #glazes),
    at = { x, 0, z },
    rotate = r:between(0, 360),
    scale = step * r:between(0.85, 1.1),
  }
end

return s
