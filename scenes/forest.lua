-- A glade: trees whose leaves are cut out by masks, all instances of three trees, on rolling ground
-- with grass.
--
-- For the forest of thesis S2, figure 6.8 (docs/bibliography.md), whose leaves re-emit light with a
-- delay (`leaves = "chlorophyll"`), and for studies of instancing. Option `trees`, the number of
-- trees: from a few hundred on, the renderer shares their meshes, and ten thousand trees take
-- little more memory than one. Option `light`: `sun` or `overcast`. Every leaf has the material
-- `leaf`, every blade of grass `grass`.

local s = scene { resolution = { 1280, 720 }, max_depth = 8 }
local count = s:option("trees", 60)
local light = s:option("light", { "sun", "overcast" })
local leaves = s:option("leaves", { "plain", "chlorophyll" })

s:view("glade", { position = { 0, 1.7, 13 }, target = { 0, 2.6, 0 }, fov = 50 })
s:view("crown", { position = { 3.2, 3.4, 5.6 }, target = { -2, 4.2, -3 }, fov = 46 })

local function clamp(x) return math.max(0, math.min(1, x)) end

local bark = texture.paint { size = { 64, 128 }, color = function(u, v)
  local groove = math.abs(noise(u * 10, v * 4, 1, 3))
  return clamp(0.22 + 0.4 * groove), clamp(0.15 + 0.3 * groove), clamp(0.10 + 0.22 * groove)
end }
-- Five pointed leaves on a twig.
local function on_leaf(u, v)
  for i = 1, 5 do
    local a = math.rad(-70 + 35 * (i - 1))
    local dx, dy = u - 0.5, v - 0.08
    local along = (dx * math.sin(a) + dy * math.cos(a)) / (i == 3 and 0.88 or 0.62)
    local across = dx * math.cos(a) - dy * math.sin(a)
    if along > 0 and along < 1 and math.abs(across) < 0.42 * along * (1 - along) ^ 0.8 then return true end
  end
  return false
end
local mask = texture.paint { size = { 96, 96 }, color = function(u, v) return on_leaf(u, v) and 1 or 0 end }
local leaf = texture.paint { size = { 48, 48 }, color = function(u, v)
  local n = 0.1 * noise(u * 7, v * 7, 2, 3)
  return clamp(0.34 + n), clamp(0.52 + n), clamp(0.16 + 0.5 * n)
end }

s:material("bark", { base_color_texture = bark, roughness = 0.95 })
if leaves == "plain" then
  s:material("leaf", { base_color_texture = leaf, mask_texture = mask, roughness = 0.45, subsurface = 0.5 })
else
  -- Green light without delay, red light after two units of optical length.
  s:material("leaf_green", { base_color_texture = leaf, roughness = 0.45, subsurface = 0.5 })
  s:material("leaf_red", { model = "lambert", base_color = { 0.8, 0.04, 0.03 }, delay = "constant", delay_constant = 2 })
  s:material("leaf", { parts = { "leaf_green", "leaf_red" }, weights = { 0.7, 0.3 }, mask_texture = mask })
end
s:material("grass", { base_color = { 0.13, 0.25, 0.05 }, roughness = 0.6 })
s:material("soil", { base_color = { 0.13, 0.09, 0.05 }, roughness = 1 })

-- With more than 250 trees the wood becomes larger, so that they do not stand too close.
local grown = math.max(1, math.sqrt(count / 250))
local function ground(x, z) return 0.9 * noise(x * 0.08, z * 0.08, 4, 3) + 0.012 * math.min(x * x + z * z, 3200) * 0.15 end
s:add {
  name = "ground",
  shape = shape.heightfield { size = { 80 * grown, 80 * grown }, cells = { 160, 160 }, height = ground },
  material = "soil",
}

-- A leaning, tapered trunk, branches, and twigs of leaves at their ends.
local sprig = shape.grid { size = { 0.5, 0.5 } }
local function tree(seed)
  local r, parts, crown = random(seed), {}, {}
  local height, lean, turn = r:between(5, 7), r:between(0, 0.6), r:between(0, 6.28)
  local function trunk(t)
    local off = lean * t * t
    return off * math.cos(turn) + 0.12 * noise(t * 3, seed), height * t, off * math.sin(turn) + 0.12 * noise(t * 3, seed, 7)
  end
  local points, radii = {}, {}
  for i = 0, 16 do
    local x, y, z = trunk(i / 16)
    points[#points + 1], radii[#radii + 1] = { x, y, z }, 0.19 * (1 - 0.85 * i / 16) + (i == 0 and 0.08 or 0)
  end
  parts[1] = { shape = shape.tube { points = points, radius = radii, segments = 12 } }
  for b = 1, 22 do
    local t = r:between(0.3, 0.97)
    local x, y, z = trunk(t)
    local a, reach, rise = 2.4 * b + r:between(-0.4, 0.4), 2.1 * (1.15 - t) + 0.35, r:between(0.1, 0.8)
    local line, thick = {}, {}
    for i = 0, 6 do
      local k = i / 6
      line[#line + 1] = { x + reach * k * math.cos(a), y + rise * k * (1.4 - k), z + reach * k * math.sin(a) }
      thick[#thick + 1] = 0.055 * (1.1 - t) * (1 - 0.8 * k) + 0.008
      if i > 1 then
        for _ = 1, 5 do
          local p = line[#line]
          crown[#crown + 1] = {
            shape = sprig,
            at = { p[1] + r:between(-0.3, 0.3), p[2] + r:between(-0.2, 0.25), p[3] + r:between(-0.3, 0.3) },
            rotate = { r:between(-60, 60), r:between(0, 360), r:between(-50, 50) },
            scale = r:between(0.7, 1.3),
          }
        end
      end
    end
    parts[#parts + 1] = { shape = shape.tube { points = line, radius = thick, segments = 7 } }
  end
  return group {
    { shape = shape.join(parts), material = "bark", name = "wood" },
    { shape = shape.join(crown), material = "leaf", name = "crown" },
  }
end
local kinds = { tree(1), tree(2), tree(3) }

local r = random(11)
local placed = 0
for _, at in ipairs(scatter { size = { 44 * grown, 44 * grown }, count = 4 * count, seed = 2 }) do
  local x, z = at[1], at[3]
  -- The glade and the line of sight to the camera stay empty.
  local clear = (x / 4.5) ^ 2 + ((z - 1) / 5) ^ 2 < 1 or (math.abs(x) < 2.2 and z > 0)
  if not clear and placed < count then
    placed = placed + 1
    s:add {
      name = "tree_" .. placed,
      shape = r:pick(kinds),
      at = { x, ground(x, z) - 0.1, z },
      rotate = r:between(0, 360),
      scale = r:between(0.75, 1.25),
    }
  end
end

-- Tufts of grass: instances of one tuft.
local blades = {}
for _ = 1, 18 do
  local a, bend, high, x, z = r:between(0, 6.28), r:between(0.05, 0.2), r:between(0.12, 0.34), r:between(-0.1, 0.1), r:between(-0.1, 0.1)
  local wide = 0.008
  local dx, dz = math.cos(a), math.sin(a)
  blades[#blades + 1] = { shape = shape.mesh {
    positions = {
      { x - wide * dz, 0, z + wide * dx }, { x + wide * dz, 0, z - wide * dx },
      { x + 0.4 * bend * dx + 0.7 * wide * dz, 0.6 * high, z + 0.4 * bend * dz - 0.7 * wide * dx },
      { x + 0.4 * bend * dx - 0.7 * wide * dz, 0.6 * high, z + 0.4 * bend * dz + 0.7 * wide * dx },
      { x + bend * dx, high, z + bend * dz },
    },
    triangles = { { 1, 2, 3 }, { 1, 3, 4 }, { 4, 3, 5 } },
  } }
end
local tuft = shape.join(blades)
for i, at in ipairs(scatter { size = { 24, 24 }, count = 1500, seed = 9 }) do
  s:add { name = "tuft_" .. i, shape = tuft, material = "grass", at = { at[1], ground(at[1], at[3]), at[3] + 3 }, rotate = r:between(0, 360) }
end

if light == "sun" then
  s:light { name = "sun", direction = { -0.55, -1, -0.5 }, irradiance = { 9, 8.2, 6.8 } }
end
local bright = light == "sun" and 0.8 or 1.6
s:environment { map = texture.paint { size = { 128, 64 }, linear = true, color = function(_, v)
  local up = clamp(2 * v - 1)
  local haze = (1 - up) ^ 3
  if v < 0.5 then return 0.02, 0.03, 0.015 end
  return bright * (0.45 + 0.7 * haze), bright * (0.65 + 0.5 * haze), bright * (1.0 + 0.2 * haze)
end } }

return s
