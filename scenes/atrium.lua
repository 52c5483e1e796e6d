-- A court with a two-storey arcade: columns, arches, chains with lamps, banners, and plants cut out
-- by masks.
--
-- Replaces the Sponza scene of thesis S0, section 5.1 (docs/bibliography.md): large and deep.
-- Option `light`: lit from above by a `skybox` or a `sun`, or only by its `lamps`. Views: along the
-- court (`atrium`), from under the arches (`gallery`), and from the upper floor (`balcony`).

local s = scene { resolution = { 1280, 720 }, max_depth = 8 }
local light = s:option("light", { "sun", "skybox", "lamps" })

s:view("atrium", { position = { -11.2, 1.7, 0.6 }, target = { 0, 3.1, -0.3 }, fov = 62 })
s:view("gallery", { position = { -9.5, 1.6, 6.1 }, target = { 2, 1.9, 4.4 }, fov = 58 })
s:view("balcony", { position = { 9.2, 6.3, -5.9 }, target = { -4, 3.2, 2.4 }, fov = 60 })

-- Materials ---------------------------------------------------------------------------------------

local function clamp(x) return math.max(0, math.min(1, x)) end

local plaster = texture.paint { size = { 256, 256 }, color = function(u, v)
  local grain = 0.06 * noise(u * 24, v * 24, 1, 4)
  local stain = 0.05 * noise(u * 3, v * 3, 5, 3)
  return clamp(0.86 + grain + stain), clamp(0.79 + grain + stain), clamp(0.68 + grain + 0.7 * stain)
end }
local marble = texture.paint { size = { 256, 256 }, color = function(u, v)
  local vein = math.abs(noise(u * 4, v * 4, 9, 5))
  local shade = 0.62 + 0.3 * clamp(vein * 2.2)
  local odd = (math.floor(u * 2) + math.floor(v * 2)) % 2
  if odd == 1 then return shade * 0.80, shade * 0.55, shade * 0.46 end
  return shade, shade * 0.97, shade * 0.92
end }
local cloth = texture.paint { size = { 64, 192 }, color = function(u, v)
  local edge = math.min(u, 1 - u) < 0.07 or v < 0.04 or v > 0.97
  local x, y = (u - 0.5) * 2, (v - 0.55) * 5
  local sun = x * x + y * y < 0.5
  local thread = 0.05 * noise(u * 120, v * 300, 0)
  if edge or sun then return clamp(0.86 + thread), clamp(0.66 + thread), clamp(0.26 + thread) end
  return clamp(0.58 + thread), clamp(0.09 + thread), clamp(0.10 + thread)
end }
-- A leaf is the region between two arcs; the mask contains a twig with seven leaves.
local function leaf_at(u, v)
  if math.abs(u - 0.5) < 0.012 and v < 0.9 then return true end
  for i = 0, 6 do
    local side = i % 2 == 0 and 1 or -1
    local cx, cy = 0.5 + side * 0.21, 0.16 + 0.12 * i
    if i == 6 then cx, cy, side = 0.5, 0.86, 0 end
    local dx, dy = u - cx, v - cy
    local a = side * 0.65
    local along, across = dx * math.cos(a) + dy * math.sin(a), -dx * math.sin(a) + dy * math.cos(a)
    if side == 0 then along, across = across, along end
    along = along / 0.23
    if math.abs(along) < 1 and math.abs(across) < 0.075 * (1 - along * along) then return true end
  end
  return false
end
local twig = texture.paint { size = { 128, 128 }, color = function(u, v) return leaf_at(u, v) and 1 or 0 end }
local green = texture.paint { size = { 64, 64 }, color = function(u, v)
  local n = 0.08 * noise(u * 9, v * 9, 3, 3)
  return clamp(0.32 + n), clamp(0.55 + n), clamp(0.22 + n)
end }

s:material("plaster", { base_color_texture = plaster, roughness = 0.9, tiling = 0.5 })
s:material("stone", { base_color = { 0.68, 0.62, 0.53 }, roughness = 0.75 })
s:material("floor", { base_color_texture = marble, roughness = 0.28, tiling = 12 })
s:material("wood", { base_color = { 0.23, 0.12, 0.06 }, roughness = 0.55 })
s:material("cloth", { base_color_texture = cloth, roughness = 0.9, sheen = 0.6, sheen_tint = 0.7 })
s:material("bronze", { base_color = { 0.66, 0.42, 0.22 }, metallic = 1, roughness = 0.35 })
s:material("clay", { base_color = { 0.55, 0.25, 0.15 }, roughness = 0.8 })
s:material("earth", { base_color = { 0.09, 0.06, 0.04 } })
s:material("leaves", { base_color_texture = green, mask_texture = twig, roughness = 0.5, subsurface = 0.4 })
local lit = light == "lamps" and { 90, 62, 32 } or { 9, 6.2, 3.2 }
s:material("flame", { emission = lit, base_color = { 0, 0, 0 } })
s:material("glass", { base_color = { 1, 0.97, 0.9 }, opacity = 0, roughness = 0, ior = 1.5 })

-- The arcade --------------------------------------------------------------------------------------

local BAY, STOREY, WALL = 3, 4.5, 0.45
local BAYS_X, BAYS_Z, DEPTH = 8, 3, 3.2 -- bays of the court, and depth of the galleries
local X, Z = BAYS_X * BAY / 2, BAYS_Z * BAY / 2

local profile = {
  { 0, 0 }, { 0.36, 0 }, { 0.36, 0.12 }, { 0.31, 0.17 }, { 0.33, 0.24 }, { 0.27, 0.3 },
  { 0.26, 0.5 }, { 0.245, 1.2 }, { 0.22, 2.0 }, { 0.22, 2.05 }, { 0.25, 2.08 }, { 0.25, 2.13 },
  { 0.29, 2.25 }, { 0.37, 2.32 }, { 0.37, 2.4 }, { 0, 2.4 },
}
local column = shape.lathe { profile = profile, segments = 40 }
local plinth = shape.box { size = { 0.8, 0.14, 0.8 }, bevel = 0.02, segments = 2 }

local outline = { { -BAY / 2, STOREY - 0.2 }, { -BAY / 2, 2.4 } }
for i = 0, 32 do
  local a = math.pi * (1 - i / 32)
  outline[#outline + 1] = { 1.15 * math.cos(a), 2.4 + 1.15 * math.sin(a) }
end
outline[#outline + 1] = { BAY / 2, 2.4 }
outline[#outline + 1] = { BAY / 2, STOREY - 0.2 }
local arch = shape.extrude { outline = outline, depth = WALL }
local rim = {}
for i = 0, 32 do
  local a = math.pi * (1 - i / 32)
  rim[#rim + 1] = { 1.2 * math.cos(a), 2.4 + 1.2 * math.sin(a), WALL / 2 }
end
local moulding = shape.tube { points = rim, radius = 0.055, segments = 10 }
local baluster = shape.lathe { segments = 20, profile = {
  { 0, 0 }, { 0.08, 0 }, { 0.08, 0.06 }, { 0.04, 0.1 }, { 0.085, 0.28 }, { 0.05, 0.5 }, { 0.035, 0.62 }, { 0.075, 0.68 },
  { 0.075, 0.74 }, { 0, 0.74 } } }
local rail = shape.box { size = { BAY, 0.12, 0.24 }, bevel = 0.02, segments = 2 }

local function bay(upper)
  local parts = {
    { shape = arch, material = "plaster" },
    { shape = moulding, material = "stone" },
    { shape = column, material = "stone", at = { -BAY / 2, 0, 0 } },
    { shape = plinth, material = "stone", at = { -BAY / 2, 0.07, 0 } },
    { shape = shape.box { size = { BAY, 0.2, WALL + 0.16 }, bevel = 0.03, segments = 2 }, material = "stone", at = { 0, STOREY - 0.1, 0 } },
  }
  if upper then
    parts[#parts + 1] = { shape = rail, material = "stone", at = { 0, 0.92, 0 } }
    parts[#parts + 1] = { shape = rail, material = "stone", at = { 0, 0.06, 0 } }
    for i = 0, 9 do
      parts[#parts + 1] = { shape = baluster, material = "stone", at = { -1.15 + 2.3 * i / 9, 0.12, 0 } }
    end
  end
  return group(parts)
end
local lower, upper = bay(false), bay(true)

for storey = 0, 1 do
  local piece, y = storey == 0 and lower or upper, storey * STOREY
  for i = 1, BAYS_X do
    local x = -X + (i - 0.5) * BAY
    s:add { shape = piece, name = ("south_%d_%d"):format(storey, i), at = { x, y, Z } }
    s:add { shape = piece, name = ("north_%d_%d"):format(storey, i), at = { -x, y, -Z }, rotate = 180 }
  end
  for i = 1, BAYS_Z do
    local z = -Z + (i - 0.5) * BAY
    s:add { shape = piece, name = ("east_%d_%d"):format(storey, i), at = { X, y, -z }, rotate = 90 }
    s:add { shape = piece, name = ("west_%d_%d"):format(storey, i), at = { -X, y, z }, rotate = -90 }
  end
end

-- Floors, outer walls, beams and the roof, which is open above the court.
local OX, OZ = X + DEPTH, Z + DEPTH
s:add { name = "floor", shape = shape.grid { size = { 2 * OX, 2 * OZ }, cells = { 8, 4 } }, material = "floor" }
local function slab(name, x, y, z, sx, sy, sz, material)
  s:add { name = name, shape = shape.box { size = { sx, sy, sz } }, material = material, at = { x, y, z } }
end
for storey = 1, 2 do
  local y = storey * STOREY + 0.08
  for _, side in ipairs { -1, 1 } do
    slab(("slab_z%+d_%d"):format(side, storey), 0, y, side * (Z + DEPTH / 2), 2 * OX, 0.16, DEPTH, "plaster")
    slab(("slab_x%+d_%d"):format(side, storey), side * (X + DEPTH / 2), y, 0, DEPTH, 0.16, 2 * Z, "plaster")
  end
  for i = 0, BAYS_X do
    for _, side in ipairs { -1, 1 } do
      slab(("beam_%d_%d_%+d"):format(storey, i, side), -X + i * BAY, y - 0.22, side * (Z + DEPTH / 2), 0.2, 0.28, DEPTH, "wood")
    end
  end
end
for _, side in ipairs { -1, 1 } do
  slab(("wall_z%+d"):format(side), 0, STOREY, side * (OZ + 0.1), 2 * OX, 2 * STOREY, 0.2, "plaster")
  slab(("wall_x%+d"):format(side), side * (OX + 0.1), STOREY, 0, 0.2, 2 * STOREY, 2 * OZ, "plaster")
  slab(("cornice_z%+d"):format(side), 0, 2 * STOREY + 0.3, side * Z, 2 * X + 0.8, 0.3, 0.8, "stone")
  slab(("cornice_x%+d"):format(side), side * X, 2 * STOREY + 0.3, 0, 0.8, 0.3, 2 * Z + 0.8, "stone")
end

-- Chains with lamps -------------------------------------------------------------------------------

local link = shape.tube { closed = true, radius = 0.012, segments = 8, points = (function()
  local points = {}
  for i = 0, 23 do
    local a = 2 * math.pi * i / 24
    points[#points + 1] = { 0.03 * math.cos(a), 0.055 * math.sin(a), 0 }
  end
  return points
end)() }
local function chain(length)
  local parts, count = {}, math.floor(length / 0.085)
  for i = 0, count - 1 do
    parts[#parts + 1] = { shape = link, at = { 0, -0.085 * i, 0 }, rotate = 90 * (i % 2) }
  end
  return group(parts)
end
local lantern = group {
  { shape = shape.cylinder { radius = 0.2, height = 0.16, top = 0.02, segments = 6 }, material = "bronze", at = { 0, 0.14, 0 } },
  { shape = shape.cylinder { radius = 0.14, height = 0.05, segments = 6 }, material = "bronze", at = { 0, -0.24, 0 } },
  { shape = shape.sphere { radius = 0.075 }, material = "flame", name = "flame", at = { 0, -0.03, 0 } },
  { shape = shape.torus { major = 0.165, minor = 0.014, segments = { 36, 8 } }, material = "bronze", at = { 0, 0.12, 0 } },
  { shape = shape.torus { major = 0.165, minor = 0.014, segments = { 36, 8 } }, material = "bronze", at = { 0, -0.19, 0 } },
}
local long, short = chain(4.2), chain(1.1)
for i = 1, BAYS_X - 1, 2 do
  local x = -X + i * BAY
  for _, side in ipairs { -1, 1 } do
    s:add { name = ("chain_%d_%+d"):format(i, side), shape = short, material = "bronze", at = { x + BAY / 2, 4.4, side * (Z + 1.5) } }
    s:add { name = ("lamp_%d_%+d"):format(i, side), shape = lantern, at = { x + BAY / 2, 3.1, side * (Z + 1.5) } }
  end
end
-- Three more lamps, each on a chain from a cable over the court.
for i = -1, 1 do
  local x = i * 6
  local cable = {}
  for k = 0, 40 do
    local t = k / 20 - 1
    cable[#cable + 1] = { x, 8.2 + 0.6 * (t * t - 1), t * Z }
  end
  s:add { name = "cable_" .. (i + 2), shape = shape.tube { points = cable, radius = 0.02, segments = 8 }, material = "bronze" }
  s:add { name = "long_chain_" .. (i + 2), shape = long, material = "bronze", at = { x, 7.6, 0 } }
  s:add { name = "court_lamp_" .. (i + 2), shape = lantern, scale = 1.8, at = { x, 3.05, 0 } }
end

-- Banners with waves ------------------------------------------------------------------------------

local r = random(5)
for i = 1, BAYS_X - 1 do
  for _, side in ipairs { -1, 1 } do
    if r:next() < 0.6 then
      local phase, depth = r:between(0, 6), r:between(0.03, 0.09)
      local sheet = shape.heightfield { size = { 1.1, 3 }, cells = { 24, 48 }, height = function(x, z)
        return depth * math.sin(5.5 * x + phase) * (0.3 + (z + 1.5) / 3) + 0.05 * math.sin(2 * z + phase)
      end }
      s:add {
        name = ("banner_%d_%+d"):format(i, side),
        shape = sheet,
        material = "cloth",
        at = { -X + i * BAY, STOREY + 0.6 - 1.5, side * (Z - 0.45) },
        rotate = { 90, 0, side > 0 and 180 or 0 },
      }
    end
  end
end

-- Plants in pots ----------------------------------------------------------------------------------

local pot = group {
  { shape = shape.lathe { segments = 40, profile = {
    { 0, 0 }, { 0.22, 0 }, { 0.3, 0.25 }, { 0.33, 0.42 }, { 0.37, 0.44 }, { 0.37, 0.5 }, { 0.32, 0.5 }, { 0.3, 0.42 }, { 0, 0.42 } } }, material = "clay" },
  { shape = shape.disk { radius = 0.3, segments = 32 }, material = "earth", at = { 0, 0.43, 0 } },
}
local spray = shape.heightfield { size = { 0.55, 0.9 }, cells = { 4, 8 }, height = function(x, z)
  return 0.35 * (z + 0.45) - 0.45 * (z + 0.45) ^ 2 - 0.4 * x * x
end }
local function plant(seed, leaves)
  local dice, parts = random(seed), {}
  for i = 1, leaves do
    local turn, lean, size = dice:between(0, 360), dice:between(20, 95), dice:between(0.6, 1.15)
    local a = math.rad(turn)
    local out = 0.34 * math.sin(math.rad(lean)) * size
    parts[#parts + 1] = {
      shape = spray,
      at = { out * math.sin(a), 0.5 + 0.45 * math.cos(math.rad(lean)) * size + dice:between(0, 0.35), out * math.cos(a) },
      rotate = { 0, turn + 180, 0 },
      scale = size,
    }
  end
  return group { { shape = pot }, { shape = group(parts), material = "leaves", name = "leaves" } }
end
local kinds = { plant(1, 70), plant(2, 90), plant(3, 60) }
for i = 1, BAYS_X do
  for _, side in ipairs { -1, 1 } do
    s:add {
      name = ("plant_%d_%+d"):format(i, side),
      shape = kinds[(i + (side > 0 and 1 or 0)) % 3 + 1],
      at = { -X + (i - 0.5) * BAY + r:between(-0.3, 0.3), 0, side * (Z - 0.75) },
      rotate = r:between(0, 360),
      scale = r:between(0.85, 1.2),
    }
  end
end
-- A basin in the middle of the court.
s:add { name = "basin", shape = shape.lathe { segments = 64, profile = {
  { 0, 0 }, { 1.3, 0 }, { 1.35, 0.4 }, { 1.45, 0.46 }, { 1.45, 0.55 }, { 1.22, 0.55 }, { 1.2, 0.12 }, { 0, 0.12 } } }, material = "stone" }
s:add { name = "ball", shape = shape.sphere { radius = 0.45 }, material = "glass", at = { 0, 0.6, 0 } }

-- Light -------------------------------------------------------------------------------------------

if light == "lamps" then
  s:environment { color = { 0.004, 0.006, 0.012 } }
else
  local bright = light == "skybox" and 2.2 or 0.9
  s:environment { map = texture.paint { size = { 256, 128 }, linear = true, color = function(u, v)
    local up = clamp(2 * v - 1)
    local cloud = clamp(2.2 * noise(u * 8, v * 5, 2, 5)) * up
    local haze = (1 - up) ^ 4
    return bright * (0.35 + 0.9 * haze + cloud), bright * (0.6 + 0.65 * haze + 0.9 * cloud), bright * (1.1 + 0.3 * haze + 0.8 * cloud)
  end } }
  if light == "sun" then
    s:light { name = "sun", direction = { 0.35, -1, -0.42 }, irradiance = { 13, 11.4, 9.2 } }
  end
end

return s
