-- A floor under a lamp of two triangles, one 24 times as large as the other.
--
-- For thesis S0, figure 4.8 (docs/bibliography.md).

local s = scene { resolution = { 256, 144 }, max_depth = 2 }
s:view("floor", { position = { 0, 2.2, 4.4 }, target = { 0, 0.3, 0 }, fov = 40 })
s:material("floor", { model = "lambert", base_color = { 0.7, 0.7, 0.7 } })
s:material("lamp", { emission = { 8, 8, 8 }, emitter_reflects = false })
s:add { name = "floor", shape = shape.grid { size = { 8, 8 } }, material = "floor" }
-- Both faces point down.
local lamp = shape.mesh {
  positions = { { -1.2, 0, -0.6 }, { 0.8, 0, -0.6 }, { -0.2, 0, 0.6 }, { 1.3, 0, 0.2 }, { 1.3, 0, 0.6 }, { 1.05, 0, 0.4 } },
  triangles = { { 1, 2, 3 }, { 4, 6, 5 } },
}
s:add { name = "lamp", shape = lamp, material = "lamp", at = { 0, 1.6, 0 } }
return s
