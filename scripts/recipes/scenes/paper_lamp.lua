-- A paper lamp on a table in front of a wall, and a branch of thin leaves beside it.
--
-- Option `transmittance`: the share of the light that the shade transmits, 0 to 0.7; it reflects a
-- further 0.25. Opens at the top, so that some light leaves without passing through the paper.

local s = scene { resolution = { 192, 144 }, max_depth = 16 }
local transmittance = s:option("transmittance", 0.5)

s:view("table", { position = { 0.2, 1.5, 4.2 }, target = { 0.1, 0.75, 0 }, fov = 34 })

s:material("wall", { model = "lambert", base_color = { 0.62, 0.6, 0.56 } })
s:material("wood", { model = "plastic", base_color = { 0.36, 0.2, 0.1 }, roughness = 0.35 })
s:material("brass", { model = "conductor", eta = { 0.44, 0.53, 1.09 }, k = { 3.6, 2.47, 1.78 }, roughness = 0.4 })
s:material("paper", {
  model = "translucent",
  base_color = { 0.25, 0.25, 0.25 },
  transmittance = { transmittance, 0.94 * transmittance, 0.8 * transmittance },
})
-- A leaf reflects green, and transmits a yellower one.
s:material("leaf", { model = "translucent", base_color = { 0.06, 0.16, 0.04 }, transmittance = { 0.18, 0.3, 0.04 } })
s:material("bulb", { emission = { 45, 37, 26 }, emitter_reflects = false })

local function quad(name, corners, material)
  s:add { name = name, material = material, shape = shape.mesh {
    positions = corners, triangles = { { 1, 2, 3 }, { 1, 3, 4 } },
  } }
end
quad("tabletop", { { -3, 0, 2 }, { 3, 0, 2 }, { 3, 0, -1 }, { -3, 0, -1 } }, "wood")
quad("backdrop", { { -3, 0, -1 }, { 3, 0, -1 }, { 3, 4, -1 }, { -3, 4, -1 } }, "wall")

-- The shade: a cone of strips, open at both ends.
local positions, triangles = {}, {}
local strips = 48
for i = 0, strips - 1 do
  local a = 2 * math.pi * i / strips
  positions[#positions + 1] = { 0.55 * math.cos(a), 0.75, 0.55 * math.sin(a) }
  positions[#positions + 1] = { 0.38 * math.cos(a), 1.45, 0.38 * math.sin(a) }
  local low, next = 2 * i + 1, 2 * ((i + 1) % strips) + 1
  triangles[#triangles + 1] = { low, low + 1, next + 1 }
  triangles[#triangles + 1] = { low, next + 1, next }
end
s:add { name = "shade", material = "paper", shape = shape.mesh { positions = positions, triangles = triangles } }
s:add { name = "lamp", material = "bulb", shape = shape.sphere { radius = 0.1 }, at = { 0, 1.05, 0 } }
s:add { name = "foot", material = "brass", shape = shape.sphere { radius = 0.3 }, at = { 0, 0.3, 0 } }

-- The branch: pointed leaves that hang beside the lamp.
for i = 1, 9 do
  local turn, y = 2.4 * i, 1.5 - 0.13 * i
  local x, z = 1.15 + 0.12 * math.sin(1.7 * i), 0.25 * math.cos(2.3 * i)
  local dx, dz = 0.3 * math.cos(turn), 0.3 * math.sin(turn)
  quad("leaf" .. i, {
    { x, y, z },
    { x + 0.5 * dx - 0.3 * dz, y - 0.06, z + 0.5 * dz + 0.3 * dx },
    { x + dx, y - 0.22, z + dz },
    { x + 0.5 * dx + 0.3 * dz, y - 0.06, z + 0.5 * dz - 0.3 * dx },
  }, "leaf")
end

return s
