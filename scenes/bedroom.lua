-- A bedroom lit through two windows: wood, cloth, a mirror, and corners that only indirect light
-- reaches.
--
-- Replaces the bedroom of thesis S0, section 5.1 (docs/bibliography.md). The windows are area
-- lights. Option `glass`: whether `panes` of smooth glass are in front of them, or `none`. Light
-- sampling finds no light through panes.

local s = scene { resolution = { 1280, 720 }, max_depth = 9 }
local glass = s:option("glass", { "none", "panes" })

s:view("door", { position = { 2.1, 1.5, 2.0 }, target = { -0.9, 0.85, -0.7 }, fov = 58 })
s:view("mirror", { position = { -1.2, 1.5, 1.9 }, target = { 2.3, 1.15, -0.6 }, fov = 52 })

local function clamp(x) return math.max(0, math.min(1, x)) end

-- Texture of the floor: planks that differ in shade and grain.
local planks = texture.paint { size = { 512, 512 }, color = function(u, v)
  local row = math.floor(v * 10)
  local along = u * 3 + 0.37 * row
  local plank = math.floor(along)
  local shade = 0.85 + 0.35 * noise(plank * 1.7, row * 2.3, 5)
  local grain = 0.12 * noise(u * 12 + plank * 9, v * 160 + row * 5, 1, 3)
  local gap = (v * 10 - row < 0.02 or along - plank < 0.008) and 0.35 or 1
  local k = gap * (shade + grain)
  return clamp(0.56 * k), clamp(0.38 * k), clamp(0.24 * k)
end }
local weave = texture.paint { size = { 128, 128 }, color = function(u, v)
  local thread = 0.08 * math.sin(u * 400) * math.sin(v * 400)
  local stripe = math.floor(v * 8) % 2 == 0
  if stripe then return clamp(0.25 + thread), clamp(0.35 + thread), clamp(0.52 + thread) end
  return clamp(0.86 + thread), clamp(0.85 + thread), clamp(0.80 + thread)
end }
local picture = texture.paint { size = { 128, 96 }, color = function(u, v)
  local hill = 0.35 + 0.12 * math.sin(u * 7) + 0.08 * noise(u * 5, 1)
  if v < hill then return clamp(0.2 + 0.5 * v), clamp(0.4 + 0.3 * v), 0.2 end
  if (u - 0.7) ^ 2 + (v - 0.75) ^ 2 < 0.006 then return 0.98, 0.85, 0.45 end
  return clamp(0.95 - 0.4 * v), clamp(0.65 + 0.1 * v), clamp(0.45 + 0.5 * v)
end }

s:material("wall", { base_color = { 0.78, 0.74, 0.66 }, roughness = 0.95 })
s:material("ceiling", { base_color = { 0.86, 0.86, 0.85 }, roughness = 1 })
s:material("floor", { base_color_texture = planks, roughness = 0.35, tiling = 1.6 })
s:material("oak", { base_color = { 0.42, 0.26, 0.13 }, roughness = 0.45 })
s:material("white", { base_color = { 0.85, 0.85, 0.83 }, roughness = 0.4 })
s:material("linen", { base_color = { 0.88, 0.87, 0.84 }, roughness = 0.95, sheen = 0.4 })
s:material("blanket", { base_color_texture = weave, roughness = 0.9, sheen = 0.5, tiling = 2 })
s:material("curtain", { base_color = { 0.72, 0.66, 0.55 }, roughness = 0.9, sheen = 0.5, subsurface = 0.3 })
s:material("brass", { base_color = { 0.8, 0.6, 0.28 }, metallic = 1, roughness = 0.25 })
s:material("silver", { base_color = { 0.93, 0.93, 0.94 }, metallic = 1, roughness = 0 })
s:material("shade", { base_color = { 0.9, 0.82, 0.68 }, roughness = 1 })
s:material("rug", { base_color = { 0.48, 0.15, 0.13 }, roughness = 1, sheen = 0.6 })
s:material("picture", { base_color_texture = picture, roughness = 0.7 })
s:material("vase", { base_color = { 0.16, 0.32, 0.42 }, roughness = 0.2, clearcoat = 1 })
s:material("pane", { base_color = { 1, 1, 1 }, opacity = 0, roughness = 0, ior = 1.5 })
s:material("daylight", { emission = { 17, 19, 22 }, base_color = { 0, 0, 0 } })

-- The room: x from -2.6 to 2.6, z from -2.1 to 2.8, height 2.7; two windows in the wall on the
-- left.
local W, H, BACK, FRONT = 2.6, 2.7, -2.1, 2.8
local function box(name, material, at, size, bevel)
  s:add { name = name, shape = shape.box { size = size, bevel = bevel or 0, segments = 3 }, material = material, at = at }
end
local middle = (BACK + FRONT) / 2
s:add { name = "floor", shape = shape.grid { size = { 2 * W, FRONT - BACK } }, material = "floor", at = { 0, 0, middle } }
s:add { name = "ceiling", shape = shape.grid { size = { 2 * W, FRONT - BACK } }, material = "ceiling", at = { 0, H, middle }, rotate = { 180, 0, 0 } }
box("wall_back", "wall", { 0, H / 2, BACK - 0.05 }, { 2 * W, H, 0.1 })
box("wall_front", "wall", { 0, H / 2, FRONT + 0.05 }, { 2 * W, H, 0.1 })
box("wall_right", "wall", { W + 0.05, H / 2, middle }, { 0.1, H, FRONT - BACK })
-- The left wall consists of the parts around the two windows.
local LOW, HIGH, HALF = 0.9, 2.2, 0.55
local windows = { -0.95, 1.35 }
box("wall_below", "wall", { -W - 0.1, LOW / 2, middle }, { 0.2, LOW, FRONT - BACK })
box("wall_above", "wall", { -W - 0.1, (H + HIGH) / 2, middle }, { 0.2, H - HIGH, FRONT - BACK })
local edges = { BACK, windows[1] - HALF, windows[1] + HALF, windows[2] - HALF, windows[2] + HALF, FRONT }
for i = 1, 5, 2 do
  local a, b = edges[i], edges[i + 1]
  box("wall_left_" .. i, "wall", { -W - 0.1, (LOW + HIGH) / 2, (a + b) / 2 }, { 0.2, HIGH - LOW, b - a })
end
for i, z in ipairs(windows) do
  local y, high = (LOW + HIGH) / 2, HIGH - LOW
  box("sill_" .. i, "white", { -W - 0.04, LOW - 0.02, z }, { 0.34, 0.05, 2 * HALF + 0.16 }, 0.015)
  for k, offset in ipairs { -HALF + 0.03, 0, HALF - 0.03 } do
    box(("frame_%d_%d"):format(i, k), "white", { -W - 0.13, y, z + offset }, { 0.06, high, 0.06 }, 0.01)
  end
  for k, offset in ipairs { -high / 2 + 0.03, 0.1, high / 2 - 0.03 } do
    box(("bar_%d_%d"):format(i, k), "white", { -W - 0.13, y + offset, z }, { 0.05, 0.06, 2 * HALF }, 0.01)
  end
  if glass == "panes" then
    box("pane_" .. i, "pane", { -W - 0.13, y, z }, { 0.006, high, 2 * HALF })
  end
  s:add { name = "window_" .. i, shape = shape.grid { size = { high + 0.1, 2 * HALF + 0.1 } }, material = "daylight", at = { -W - 0.24, y, z }, rotate = { 0, 0, -90 } }
  -- A rod and two curtains with folds.
  local rod = {}
  for k = -1, 1 do rod[#rod + 1] = { -W + 0.09, HIGH + 0.14, z + 0.95 * k } end
  s:add { name = "rod_" .. i, shape = shape.tube { points = rod, radius = 0.014 }, material = "brass" }
  for _, side in ipairs { -1, 1 } do
    local folds = shape.heightfield { size = { 0.42, 2.15 }, cells = { 110, 90 }, height = function(x, t)
      local open = 1 + 0.25 * (t + 1.07) / 2.15
      return 0.035 * open * math.sin(78 * x / open + 0.6 * math.sin(2 * t)) + 0.012 * noise(9 * x, 2 * t, i + side)
    end }
    s:add {
      name = ("curtain_%d_%+d"):format(i, side),
      shape = folds,
      material = "curtain",
      at = { -W + 0.09, HIGH + 0.13 - 1.075, z + side * 0.73 },
      rotate = { 90, 0, -90 },
    }
  end
end
for _, z in ipairs { BACK + 0.01, FRONT - 0.01 } do
  box(("skirting_%d"):format(z > 0 and 1 or 2), "white", { 0, 0.05, z }, { 2 * W, 0.1, 0.03 }, 0.005)
end
box("skirting_right", "white", { W - 0.01, 0.05, middle }, { 0.03, 0.1, FRONT - BACK }, 0.005)

-- The bed: a frame, a mattress, a blanket that falls over its sides, and pillows.
local BX, BZ = -0.35, -0.75
box("bed_base", "oak", { BX, 0.2, BZ }, { 1.66, 0.22, 2.1 }, 0.03)
box("bed_head", "oak", { BX, 0.6, BACK + 0.08 }, { 1.76, 1.2, 0.09 }, 0.04)
for k, x in ipairs { -0.76, 0.76 } do
  box("bed_foot_" .. k, "oak", { BX + x, 0.06, BZ + 0.95 }, { 0.09, 0.12, 0.09 }, 0.01)
end
box("mattress", "linen", { BX, 0.42, BZ }, { 1.6, 0.24, 2.04 }, 0.07)
local WIDE, LONG = 2.3, 1.75
local blanket = shape.heightfield { size = { WIDE, LONG }, cells = { 280, 240 }, height = function(x, z)
  local over = math.max(0, math.abs(x) - 0.8)
  local foot = math.max(0, z - 0.72)
  local fall = 1.9 * math.min(over, 0.32) + 1.5 * math.min(foot, 0.2)
  local crease = 0.018 * noise(3.2 * x, 2.6 * z, 3, 4) + 0.010 * noise(9 * x, 8 * z, 8, 2)
  local wave = 0.02 * over / 0.35 * math.sin(16 * z) + 0.02 * foot / 0.15 * math.sin(14 * x)
  return 0.035 + crease + wave - fall
end }
s:add { name = "blanket", shape = blanket, material = "blanket", at = { BX, 0.545, BZ + 0.33 } }
for k, x in ipairs { -0.4, 0.4 } do
  local pillow = shape.ball { radius = 0.5, splits = 6 }
  s:add { name = "pillow_" .. k, shape = pillow, material = "linen", at = { BX + x, 0.64, BACK + 0.42 }, rotate = { 24, 4 * k, 0 }, scale = { 0.66, 0.2, 0.42 } }
end

-- Bedside tables with lamps that are switched off, and a book.
local lampshade = shape.lathe { segments = 64, profile = { { 0.19, 0 }, { 0.13, 0.24 }, { 0.125, 0.24 }, { 0.185, 0 } } }
local foot = shape.lathe { segments = 48, profile = {
  { 0, 0 }, { 0.1, 0 }, { 0.1, 0.015 }, { 0.03, 0.04 }, { 0.02, 0.09 }, { 0.05, 0.16 }, { 0.055, 0.2 }, { 0.03, 0.26 }, { 0.012, 0.3 }, { 0.012, 0.42 }, { 0, 0.42 } } }
local drawer = group {
  { shape = shape.box { size = { 0.46, 0.46, 0.4 }, bevel = 0.015 }, material = "oak", at = { 0, 0.29, 0 } },
  { shape = shape.box { size = { 0.4, 0.16, 0.02 }, bevel = 0.008 }, material = "oak", at = { 0, 0.39, 0.205 } },
  { shape = shape.box { size = { 0.4, 0.16, 0.02 }, bevel = 0.008 }, material = "oak", at = { 0, 0.2, 0.205 } },
  { shape = shape.ball { radius = 0.014, splits = 3 }, material = "brass", at = { 0, 0.39, 0.225 } },
  { shape = shape.ball { radius = 0.014, splits = 3 }, material = "brass", at = { 0, 0.2, 0.225 } },
  { shape = foot, material = "brass", at = { 0, 0.52, -0.03 } },
  { shape = lampshade, material = "shade", at = { 0, 0.86, -0.03 } },
}
s:add { name = "night_left", shape = drawer, at = { BX - 1.2, 0, BACK + 0.26 } }
s:add { name = "night_right", shape = drawer, at = { BX + 1.2, 0, BACK + 0.26 } }
box("book", "rug", { BX + 1.32, 0.535, BACK + 0.36 }, { 0.15, 0.03, 0.21 }, 0.006)

-- A wardrobe with a mirror on the right, a rug, a picture, and a chest with a vase and books.
box("wardrobe", "oak", { W - 0.32, 1.05, -0.9 }, { 0.6, 2.1, 1.7 }, 0.02)
for k, z in ipairs { -1.32, -0.48 } do
  box("door_" .. k, "oak", { W - 0.64, 1.08, z }, { 0.04, 1.92, 0.8 }, 0.012)
  box("handle_" .. k, "brass", { W - 0.68, 1.1, k == 1 and -0.97 or -0.83 }, { 0.02, 0.16, 0.02 }, 0.008)
end
box("mirror", "silver", { W - 0.665, 1.15, -0.48 }, { 0.008, 1.5, 0.56 })
box("rug", "rug", { 0.55, 0.012, 1.15 }, { 2.2, 0.024, 1.5 }, 0.01)
box("picture_frame", "oak", { BX, 1.75, BACK + 0.02 }, { 1.02, 0.72, 0.04 }, 0.01)
s:add { name = "picture", shape = shape.grid { size = { 0.92, 0.62 } }, material = "picture", at = { BX, 1.75, BACK + 0.042 }, rotate = { 90, 0, 0 } }
box("chest", "oak", { 1.9, 0.4, 2.45 }, { 1.1, 0.8, 0.5 }, 0.02)
s:add { name = "vase", shape = shape.lathe { segments = 96, profile = {
  { 0, 0 }, { 0.07, 0 }, { 0.12, 0.1 }, { 0.13, 0.18 }, { 0.09, 0.28 }, { 0.045, 0.34 }, { 0.06, 0.4 }, { 0.05, 0.4 }, { 0.035, 0.34 }, { 0, 0.3 } } }, material = "vase", at = { 1.65, 0.8, 2.45 } }
local r = random(4)
local x = 1.9
for k = 1, 7 do
  local thick, high = r:between(0.025, 0.05), r:between(0.2, 0.27)
  box("shelf_book_" .. k, ({ "rug", "vase", "linen", "curtain" })[k % 4 + 1], { x, 0.8 + high / 2, 2.42 }, { thick, high, 0.17 }, 0.004)
  x = x + thick + 0.006
end

return s
