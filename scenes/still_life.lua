-- Glass, metal and a small lamp on a table: caustics from refraction and reflection.
--
-- The glass ball and the brass ring focus the light of the lamp onto the table; a copper knot and a
-- glazed cup reflect both. Option `lamp`, the radius of the lamp in metres with its power kept: the smaller it is,
-- the rarer is a path from the camera that meets it.

local s = scene { resolution = { 512, 512 }, max_depth = 8 }
local radius = s:option("lamp", 0.05)

s:view("front", { position = { 0.02, 0.52, 1.2 }, target = { 0.02, 0.13, 0 }, fov = 34 })
s:view("ring", { position = { 0.3, 0.3, 0.75 }, target = { 0.13, 0.03, 0.24 }, fov = 38 })

s:material("table", { base_color = { 0.6, 0.5, 0.4 }, roughness = 1 })
s:material("wall", { base_color = { 0.45, 0.6, 0.7 }, roughness = 1 })
s:material("glass", { opacity = 0, roughness = 0, ior = 1.5 })
s:material("brass", { base_color = { 0.95, 0.73, 0.35 }, metallic = 1, roughness = 0.12 })
s:material("copper", { base_color = { 0.93, 0.55, 0.4 }, metallic = 1, roughness = 0.3 })
s:material("glaze", { base_color = { 0.75, 0.12, 0.1 }, roughness = 0.6, clearcoat = 1, clearcoat_gloss = 0.95 })
local power = 0.3 / (radius * radius)
s:material("lamp", { emission = { power, 0.88 * power, 0.7 * power }, emitter_reflects = false })

-- The table fills the floor of a small room, whose walls give the light back.
local room = shape.box { size = { 2.4, 1.4, 2.4 } }
s:add { name = "room", shape = room, material = "wall", at = { 0, 0.69, 0.3 } }
s:add { name = "table", shape = shape.grid { size = { 2.4, 2.4 } }, material = "table", at = { 0, 0, 0.3 } }

s:add { name = "ball", shape = shape.sphere { radius = 0.12 }, material = "glass", at = { -0.17, 0.121, 0.16 } }

local band = shape.lathe { segments = 256, profile = {
  { 0.13, 0 }, { 0.137, 0.012 }, { 0.139, 0.035 }, { 0.137, 0.058 }, { 0.13, 0.07 }, { 0.126, 0.058 }, { 0.125, 0.035 }, { 0.126, 0.012 }, { 0.13, 0 } } }
s:add { name = "ring", shape = band, material = "brass", at = { 0.16, 0.001, 0.25 } }

-- A (2, 3) torus knot.
local points, n = {}, 240
for i = 0, n - 1 do
  local t = 2 * math.pi * i / n
  local out = 0.25 + 0.1 * math.cos(3 * t)
  points[#points + 1] = { out * math.cos(2 * t), 0.14 * math.sin(3 * t), out * math.sin(2 * t) }
end
local knot = shape.tube { points = points, radius = 0.075, segments = 32, closed = true }
s:add { name = "knot", shape = knot, material = "copper", at = { 0.24, 0.16, -0.2 }, rotate = { 75, 20, 0 }, scale = 0.36 }

local cup = shape.lathe { segments = 96, profile = {
  { 0, 0.012 }, { 0.07, 0.012 }, { 0.085, 0.05 }, { 0.1, 0.16 }, { 0.105, 0.2 }, { 0.112, 0.2 }, { 0.108, 0.16 }, { 0.092, 0.05 }, { 0.08, 0 }, { 0, 0 } } }
s:add { name = "cup", shape = cup, material = "glaze", at = { -0.24, 0.001, -0.22 } }

s:add { name = "lamp", shape = shape.sphere { radius = radius }, material = "lamp", at = { -0.5, 0.75, 0.2 } }

return s
