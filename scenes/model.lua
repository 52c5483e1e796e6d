-- One mesh under a uniform sky, to compare acceleration structures.
--
-- Option `model`: one of the three models with which thesis S1, section 5.1, compares hierarchies
-- (docs/bibliography.md). They are not part of this project. Option `folder`: the folder of
-- suzanne.obj, stanford-bunny.obj and stanford-dragon-res2.ply, relative to this file or absolute.
-- Without it, each is replaced by a knot with about as many triangles (a thousand, seventy
-- thousand, two hundred thousand). Option `floor` adds a floor, whose large bounding box is a hard
-- case for splits at a plane.

local s = scene { resolution = { 512, 384 }, max_depth = 5 }
local model = s:option("model", { "suzanne", "bunny", "dragon" })
local folder = s:option("folder", "")
local floor = s:option("floor", false)

s:view("front", { position = { 1.1, 1.1, 3.2 }, target = { 0, 0.55, 0 }, fov = 30 })
s:view("side", { position = { 3.3, 0.9, -0.7 }, target = { 0, 0.55, 0 }, fov = 30 })
s:material("clay", { base_color = { 0.7, 0.6, 0.5 }, roughness = 0.7 })
s:material("floor", { base_color = { 0.4, 0.4, 0.42 }, roughness = 0.9 })
if floor then s:add { name = "floor", shape = shape.grid { size = { 8, 8 } }, material = "floor" } end
s:environment { color = { 1, 1, 1 } }

-- File, centre of its base, its height, and the cells of the knot that replaces it.
local known = {
  suzanne = { "suzanne.obj", { -2.494, 0.2673, 4.104 }, 1.9688, { 44, 11 } },
  bunny = { "stanford-bunny.obj", { -0.0168, 0.033, -0.0015 }, 0.1543, { 434, 80 } },
  dragon = { "stanford-dragon-res2.ply", { -0.0059, 0.0527, -0.0046 }, 0.1444, { 844, 120 } },
}
local file, foot, height, cells = table.unpack(known[model])

if folder ~= "" then
  local scale = 1.1 / height
  s:import(folder .. "/" .. file, {
    material = "clay",
    place = { at = { -foot[1] * scale, -foot[2] * scale, -foot[3] * scale }, scale = scale },
  })
else
  -- A (2, 3) torus knot.
  local points = {}
  for i = 0, cells[1] - 1 do
    local t = 2 * math.pi * i / cells[1]
    local out = 0.4 + 0.17 * math.cos(3 * t)
    points[#points + 1] = { out * math.cos(2 * t), 0.55 + 0.3 * math.sin(3 * t), out * math.sin(2 * t) }
  end
  s:add {
    name = "knot",
    shape = shape.tube { points = points, radius = 0.13, segments = cells[2], closed = true },
    material = "clay",
  }
end

return s
