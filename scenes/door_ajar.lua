-- A room that is lit through a door ajar: all its light comes from a lamp in the next room, through
-- a gap.
--
-- After the scenes of Veach 1997, chapter 11, and of Lafortune and Willems 1995
-- (docs/bibliography.md); geometry and materials are our own. Light sampling finds nothing in the
-- room itself, since every connection to the lamp is blocked. Option `opening`: the angle of the door in
-- degrees; 0 shuts it.

local s = scene { resolution = { 960, 540 }, max_depth = 9 }
local opening = s:option("opening", 14)

s:view("room", { position = { 1.55, 1.5, 2.2 }, target = { -0.25, 0.85, -0.9 }, fov = 52 })
s:view("table", { position = { 0.7, 1.15, 1.0 }, target = { -0.45, 0.72, -0.1 }, fov = 40 })

s:material("wall", { base_color = { 0.72, 0.68, 0.6 }, roughness = 1 })
s:material("ceiling", { base_color = { 0.8, 0.8, 0.78 }, roughness = 1 })
s:material("floor", { base_color = { 0.34, 0.22, 0.14 }, roughness = 0.6 })
s:material("next_wall", { base_color = { 0.8, 0.8, 0.8 }, roughness = 1 })
s:material("door", { base_color = { 0.55, 0.36, 0.2 }, roughness = 0.7 })
s:material("wood", { base_color = { 0.42, 0.27, 0.15 }, roughness = 0.6 })
s:material("brass", { base_color = { 0.9, 0.7, 0.35 }, metallic = 1, roughness = 0.35 })
s:material("clay", { base_color = { 0.62, 0.28, 0.2 }, roughness = 0.9 })
s:material("glaze", { base_color = { 0.25, 0.42, 0.5 }, roughness = 0.3 })
s:material("lamp", { emission = { 1800, 1620, 1350 }, base_color = { 0, 0, 0 } })

local function box(name, material, at, size, rotate)
  s:add { name = name, shape = shape.box { size = size }, material = material, at = at, rotate = rotate or 0 }
end

-- Both rooms: x from -2 to 2, height 2.5, walls 0.2 thick; this one has z from -1.5 to 2.7, the
-- next one z from -4.7 to -1.7.
local W, H, T = 2, 2.5, 0.2
local FRONT, BACK, NEXT, FAR = 2.7, -1.5, -1.7, -4.7
box("floor", "floor", { 0, -T / 2, (FRONT + FAR) / 2 }, { 2 * W + 2 * T, T, FRONT - FAR + 2 * T })
box("ceiling", "ceiling", { 0, H + T / 2, (FRONT + FAR) / 2 }, { 2 * W + 2 * T, T, FRONT - FAR + 2 * T })
for _, side in ipairs { -1, 1 } do
  local x = side * (W + T / 2)
  box(("side_%+d"):format(side), "wall", { x, H / 2, (FRONT + BACK) / 2 }, { T, H, FRONT - BACK })
  box(("next_side_%+d"):format(side), "next_wall", { x, H / 2, (BACK + FAR) / 2 }, { T, H, BACK - FAR })
end
box("front", "wall", { 0, H / 2, FRONT + T / 2 }, { 2 * W, H, T })
box("far", "next_wall", { 0, H / 2, FAR - T / 2 }, { 2 * W, H, T })

-- The wall between, around a doorway with x from 0.4 to 1.3.
local LEFT, RIGHT, TOP = 0.4, 1.3, 2.05
local z = (BACK + NEXT) / 2
box("between_left", "wall", { (LEFT - W) / 2, H / 2, z }, { LEFT + W, H, T })
box("between_right", "wall", { (RIGHT + W) / 2, H / 2, z }, { W - RIGHT, H, T })
box("between_above", "wall", { (LEFT + RIGHT) / 2, (TOP + H) / 2, z }, { RIGHT - LEFT, H - TOP, T })

-- The door turns about its right edge into this room, so that the camera does not see the gap.
local turn = math.rad(opening)
local width, thick = RIGHT - LEFT, 0.04
local half = width / 2
local along = { math.cos(turn), math.sin(turn) }
box("door", "door",
  { RIGHT - half * along[1], TOP / 2, BACK - thick / 2 + half * along[2] },
  { width, TOP, thick }, opening)
local knob = width - 0.08
s:add {
  name = "knob", shape = shape.sphere { radius = 0.035 }, material = "brass",
  at = { RIGHT - knob * along[1] + 0.05 * along[2], 1.02, BACK - thick / 2 + knob * along[2] + 0.05 * along[1] },
}

-- The lamp: a panel below the ceiling of the next room. No light passes from it through the gap
-- without a reflection.
s:add { name = "lamp", shape = shape.grid { size = { 0.8, 0.8 } }, material = "lamp", at = { -1.3, H - 0.05, -3.4 }, rotate = { 180, 0, 0 } }

-- A table with vases and a brass ball, a picture frame, and a bench.
box("table_top", "wood", { -0.5, 0.7, -0.2 }, { 1.4, 0.04, 0.8 })
for i, at in ipairs { { -1.15, 0.15 }, { 0.15, 0.15 }, { -1.15, -0.55 }, { 0.15, -0.55 } } do
  box("leg_" .. i, "wood", { at[1], 0.34, at[2] }, { 0.06, 0.68, 0.06 })
end
local vase = shape.lathe { profile = {
  { 0.001, 0 }, { 0.09, 0 }, { 0.14, 0.12 }, { 0.12, 0.22 }, { 0.05, 0.3 }, { 0.06, 0.38 }, { 0.045, 0.38 }, { 0.035, 0.3 },
} }
s:add { name = "vase", shape = vase, material = "glaze", at = { -0.85, 0.72, -0.25 } }
s:add { name = "pot", shape = vase, material = "clay", at = { -0.1, 0.72, -0.35 }, scale = 0.75 }
s:add { name = "ball", shape = shape.sphere { radius = 0.11 }, material = "brass", at = { -0.42, 0.83, 0 } }
box("frame", "wood", { -0.9, 1.55, BACK + 0.015 }, { 0.9, 0.6, 0.03 })
box("picture", "glaze", { -0.9, 1.55, BACK + 0.035 }, { 0.78, 0.48, 0.012 })
box("bench", "clay", { -1.7, 0.22, 0.9 }, { 0.5, 0.44, 1.5 })

return s
