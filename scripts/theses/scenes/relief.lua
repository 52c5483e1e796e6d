-- A sphere with bricks in relief, painted as a normal map, under a lamp from the side.
--
-- For thesis S1, figure 3.9 (docs/bibliography.md).

local s = scene { resolution = { 256, 256 }, max_depth = 4 }
s:view("front", { position = { 0, 0, 4 }, target = { 0, 0, 0 }, fov = 34 })

-- Height of the bricks, 1 on a brick and 0 between them.
local function height(u, v)
  local row = math.floor(v * 16)
  local x, y = (u * 24 + 0.5 * (row % 2)) % 1, (v * 16) % 1
  local function edge(t) return math.min(1, 8 * math.min(t, 1 - t)) end
  return math.min(edge(x), edge(y))
end
-- Normals in the tangent frame, from differences of the height.
local normals = texture.paint { size = { 384, 256 }, linear = true, color = function(u, v)
  local d = 1 / 384
  local dx, dy = height(u + d, v) - height(u - d, v), height(u, v + d) - height(u, v - d)
  local length = math.sqrt(dx * dx + dy * dy + 1)
  return 0.5 - 0.5 * dx / length, 0.5 - 0.5 * dy / length, 0.5 + 0.5 / length
end }
s:material("relief", { base_color = { 0.6, 0.28, 0.2 }, roughness = 0.5, normal_texture = normals })
s:material("wall", { base_color = { 0.5, 0.5, 0.5 } })
s:material("lamp", { emission = { 14, 13, 12 }, emitter_reflects = false })

-- A ball of revolution, whose texture coordinates run along it.
local profile = {}
for i = 0, 48 do
  local a = math.pi * (i / 48 - 0.5)
  profile[#profile + 1] = { math.max(0, math.cos(a)), math.sin(a) }
end
profile[1][1], profile[49][1] = 0, 0
s:add { name = "sphere", shape = shape.lathe { segments = 96, profile = profile }, material = "relief" }
s:add { name = "wall", shape = shape.grid { size = { 12, 12 } }, material = "wall", at = { 0, 0, -2 }, rotate = { 90, 0, 0 } }
s:add { name = "lamp", shape = shape.sphere { radius = 0.4 }, material = "lamp", at = { -3, 2.2, 2.4 } }
return s
