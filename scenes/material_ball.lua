-- One object on a pedestal under fixed lights: the appearance of a material.
--
-- Option `shape`, the object: a `ball`, a `knot` of varying curvature, a `cube` with rounded edges,
-- or `facets`, a coarse ball of triangles with smooth normals. Its material is always named `ball`;
-- scripts set its parameters. Option `light`: `lamps`, with the studio of
-- material_ball/material_ball.scn, or `sky`, a painted sky with a low sun over the floor of the
-- studio. View `floor` is close to the floor's texture.

local s = scene { resolution = { 256, 256 }, max_depth = 8 }
local kind = s:option("shape", { "ball", "knot", "cube", "facets" })
local light = s:option("light", { "lamps", "sky" })

s:view("front", { position = { 0, 1.35, 2.7 }, target = { 0, 0.56, 0 }, fov = 29 })
s:view("side", { position = { 2, 1.1, 1.3 }, target = { 0, 0.58, 0 }, fov = 28 })
s:view("floor", { position = { 0.55, 0.16, 1.05 }, target = { 0.2, 0, 0.5 }, fov = 30 })

s:material("ball", { base_color = { 0.8, 0.8, 0.8 }, roughness = 0.5 })
s:material("base", { base_color = { 0.12, 0.12, 0.13 }, roughness = 0.6 })
s:material("checks", { base_color = { 0.9, 0.9, 0.9 }, base_color_texture = "material_ball/checks.png" })
s:material("ceiling", { base_color = { 0.75, 0.75, 0.75 } })
s:material("key", { emission = { 5, 4.8, 4.5 }, emitter_reflects = false })
s:material("rim", { emission = { 5.5, 5.9, 6.5 }, emitter_reflects = false })
if light == "lamps" then
  s:import("material_ball/studio.obj")
else
  s:add { name = "floor", shape = shape.grid { size = { 8, 8 } }, material = "checks" }
  -- The sun covers 2 by 2 of 256 by 128 texels, 24 degrees above the horizon.
  s:environment { map = texture.paint { size = { 256, 128 }, linear = true, color = function(u, v)
    if math.abs(u - 93 / 256) < 1 / 256 and math.abs(v - 81 / 128) < 1 / 128 then return 4000, 3600, 3000 end
    local up = math.max(0, 2 * v - 1)
    return 0.9 - 0.6 * up, 0.95 - 0.45 * up, 1
  end } }
end
s:import("material_ball/base.obj")

if kind == "ball" then
  s:add { name = "ball", shape = shape.sphere { radius = 0.48 }, material = "ball", at = { 0, 0.6, 0 } }
elseif kind == "facets" then
  s:add { name = "ball", shape = shape.ball { radius = 0.48, splits = 1 }, material = "ball", at = { 0, 0.6, 0 } }
elseif kind == "cube" then
  s:add {
    name = "ball",
    shape = shape.box { size = { 0.74, 0.74, 0.74 }, bevel = 0.09, segments = 12 },
    material = "ball",
    at = { 0, 0.52, 0 },
    rotate = 33,
  }
else
  -- A (2, 3) torus knot.
  local points, n = {}, 480
  for i = 0, n - 1 do
    local t = 2 * math.pi * i / n
    local out = 0.25 + 0.1 * math.cos(3 * t)
    points[#points + 1] = { out * math.cos(2 * t), 0.14 * math.sin(3 * t), out * math.sin(2 * t) }
  end
  local knot = shape.tube { points = points, radius = 0.075, segments = 48, closed = true }
  s:add { name = "ball", shape = knot, material = "ball", at = { 0, 0.58, 0 }, rotate = { 70, 0, 0 }, scale = 1.2 }
end

return s
