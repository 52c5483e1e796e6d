-- A wall of small lamps over a row of balls: the cost of sampling one light among many.
--
-- Option `lights`, the number of lamps, from ten to ten thousand. Their total power is constant, so
-- that the picture stays similar while light sampling becomes harder. Option `kind`: `spheres` with
-- a surface, or `points`.

local s = scene { resolution = { 960, 540 }, max_depth = 4 }
local count = s:option("lights", 1000)
local kind = s:option("kind", { "spheres", "points" })

s:view("row", { position = { 0, 3.2, 11 }, target = { 0, 1.5, 0 }, fov = 38 })
s:view("gold", { position = { 5.2, 1.7, 5.2 }, target = { 2.7, 1.15, 0 }, fov = 34 })

s:material("floor", { base_color = { 0.6, 0.6, 0.6 }, roughness = 0.5 })
s:material("wall", { base_color = { 0.35, 0.38, 0.45 }, roughness = 0.9 })
s:material("gold", { base_color = { 0.95, 0.7, 0.3 }, metallic = 1, roughness = 0.3 })
s:material("china", { base_color = { 0.85, 0.85, 0.9 }, roughness = 0.4, clearcoat = 1 })
s:material("matte", { base_color = { 0.7, 0.25, 0.2 }, model = "lambert" })

s:add { name = "floor", shape = shape.grid { size = { 40, 30 } }, material = "floor" }
s:add { name = "back", shape = shape.grid { size = { 40, 20 } }, material = "wall", at = { 0, 10, -4.2 }, rotate = { 90, 0, 0 } }
for i, material in ipairs { "matte", "china", "gold" } do
  s:add { name = material, shape = shape.sphere { radius = 1.1 }, material = material, at = { 2.9 * (i - 2), 1.1, 0 } }
end

-- Lamps of random colours, a third of them in front of the wall, the others above the camera.
local r = random(3)
local radius = math.min(0.09, 1.2 / math.sqrt(count))
local radiance = 480 / (count * math.pi * radius * radius * 4)
local colors = 12
for c = 1, colors do
  local hue = 2 * math.pi * c / colors
  local function part(shift) return radiance * (0.65 + 0.35 * math.cos(hue + shift)) end
  s:material("lamp_" .. c, { emission = { part(0), part(2.1), part(4.2) }, base_color = { 0, 0, 0 } })
end
local bulb = shape.sphere { radius = radius }
for i, at in ipairs(scatter { size = { 18, 5 }, count = count, seed = 1 }) do
  local place = i <= count / 3 and { at[1], 3.6 + 0.9 * at[3], -3.6 } or { at[1], 6.5, 4.5 + 0.8 * at[3] }
  local c = r:integer(1, colors)
  if kind == "spheres" then
    s:add { name = "bulb_" .. i, shape = bulb, material = "lamp_" .. c, at = place }
  else
    local hue = 2 * math.pi * c / colors
    local function part(shift) return 480 / (4 * count) * (0.65 + 0.35 * math.cos(hue + shift)) end
    s:light { name = "bulb_" .. i, position = place, intensity = { part(0), part(2.1), part(4.2) } }
  end
end

return s
