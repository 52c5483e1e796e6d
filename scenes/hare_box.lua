-- A white box with a hare, for transient rendering: after the scene of thesis S2, chapter 6
-- (docs/bibliography.md).
--
-- The box is two units wide, so that a flash of its light reaches the camera after 2 to 3 units of
-- optical length and has crossed the box some units later. The hare has the material `hare`. Option
-- `hare`: `plain`; `patches`, whose delay is a pattern of black (0) and white (1), to which a
-- script adds a profile by `set`; `chlorophyll`, green without delay and red later; `complex`, blue
-- and yellow, each delayed by the pattern (figure 6.7). Option `bunny`: a mesh that replaces the
-- hare, such as the Stanford bunny, relative to this folder. View `front` is for figures; `hare` is
-- closer.

local s = scene { resolution = { 256, 256 }, max_depth = 6 }
local kind = s:option("hare", { "plain", "patches", "chlorophyll", "complex" })
local bunny = s:option("bunny", "")

s:view("front", { position = { 0, 0, 3.9 }, target = { 0, 0, 0 }, fov = 39.3077 })
s:view("hare", { position = { 0.3, -0.2, 2.2 }, target = { 0, -0.55, 0 }, fov = 38 })

s:material("white", { model = "lambert", base_color = { 0.8, 0.8, 0.8 } })
s:material("lamp", { emission = { 12, 12, 12 }, emitter_reflects = false })

local function wall(name, at, rotate)
  s:add { name = name, shape = shape.grid { size = { 2, 2 } }, material = "white", at = at, rotate = rotate }
end
wall("floor", { 0, -1, 0 }, { 0, 0, 0 })
wall("ceiling", { 0, 1, 0 }, { 180, 0, 0 })
wall("back", { 0, 0, -1 }, { 90, 0, 0 })
wall("left", { -1, 0, 0 }, { 0, 0, -90 })
wall("right", { 1, 0, 0 }, { 0, 0, 90 })
s:add { name = "lamp", shape = shape.grid { size = { 0.5, 0.5 } }, material = "lamp", at = { 0, 0.99, 0 }, rotate = { 180, 0, 0 } }

-- Patches on the body of the hare, black and white.
local patches = texture.paint { size = { 64, 64 }, color = function(u, v)
  return noise(u * 5 + 3, v * 5, 2, 2) > 0 and 1 or 0
end }

local red = { 0.75, 0.1, 0.1 }
if kind == "plain" then
  s:material("hare", { model = "lambert", base_color = red })
elseif kind == "patches" then
  s:material("hare", { model = "lambert", base_color = red, delay_constant_texture = patches, delay = "constant", delay_constant = 1 })
elseif kind == "chlorophyll" then
  s:material("hare_green", { model = "lambert", base_color = { 0.08, 0.75, 0.1 } })
  s:material("hare_red", { model = "lambert", base_color = { 0.85, 0.06, 0.06 }, delay = "constant", delay_constant = 1 })
  s:material("hare", { parts = { "hare_green", "hare_red" }, weights = { 0.5, 0.5 } })
else
  -- Black parts of the pattern: blue without delay, yellow after 1; white parts: the same, 2 later.
  local late = { model = "lambert", delay = "constant", delay_constant = 2, delay_constant_texture = patches }
  late.base_color = { 0.1, 0.2, 0.85 }
  s:material("hare_blue", late)
  late.base_color, late.delay_constant_offset = { 0.85, 0.75, 0.08 }, 1
  s:material("hare_yellow", late)
  s:material("hare", { parts = { "hare_blue", "hare_yellow" }, weights = { 0.5, 0.5 } })
end

if bunny ~= "" then
  -- The Stanford bunny has no texture coordinates.
  s:import(bunny, { material = "hare", project = "plane", place = { scale = 7, at = { 0.12, -1.23, 0.05 } } })
  return s
end

-- A hare of spheroids: body, haunches, chest, head, ears, paws and a tail.
local function spheroid(radius, length)
  local profile = {}
  for i = 0, 24 do
    local a = math.pi * (i / 24 - 0.5)
    profile[#profile + 1] = { math.max(0, radius * math.cos(a)), length * math.sin(a) }
  end
  profile[1][1], profile[25][1] = 0, 0
  return shape.lathe { segments = 48, profile = profile }
end
local round, long = spheroid(0.5, 0.5), spheroid(0.5, 0.62)
local ear = spheroid(0.5, 1.6)
s:add {
  name = "hare",
  shape = group {
    { shape = long, at = { 0.05, 0.46, 0 }, rotate = { 0, 0, 64 }, scale = 0.82 },
    { shape = round, at = { 0.33, 0.33, 0.19 }, scale = 0.5 },
    { shape = round, at = { 0.33, 0.33, -0.19 }, scale = 0.5 },
    { shape = round, at = { -0.26, 0.52, 0 }, scale = 0.52 },
    { shape = long, at = { -0.42, 0.86, 0 }, rotate = { 0, 0, 72 }, scale = 0.42 },
    { shape = ear, at = { -0.27, 1.22, 0.09 }, rotate = { 14, 0, -18 }, scale = 0.155 },
    { shape = ear, at = { -0.27, 1.22, -0.09 }, rotate = { -14, 0, -18 }, scale = 0.155 },
    { shape = long, at = { -0.3, 0.16, 0.15 }, rotate = { 0, 0, 80 }, scale = 0.24 },
    { shape = long, at = { -0.3, 0.16, -0.15 }, rotate = { 0, 0, 80 }, scale = 0.24 },
    { shape = long, at = { 0.2, 0.1, 0.27 }, rotate = { 0, 0, 86 }, scale = 0.3 },
    { shape = long, at = { 0.2, 0.1, -0.27 }, rotate = { 0, 0, 86 }, scale = 0.3 },
    { shape = round, at = { 0.55, 0.5, 0 }, scale = 0.18 },
  },
  material = "hare",
  at = { 0.05, -1, 0.1 },
  rotate = { 0, -24, 0 },
  scale = 0.95,
}
return s
