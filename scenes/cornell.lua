-- The Cornell box and variants: the same box and light with different contents.
--
-- Option `inside`, the contents: the measured `blocks`, a mirror and a glass sphere (`spheres`),
-- the same two as triangle meshes (`balls`), a ring of `metal` whose caustic is a curve on the
-- floor, or nothing (`empty`). Geometry, paints and light are those of cornell/cornell.scn.

local s = scene { resolution = { 512, 512 }, max_depth = 9 }
local inside = s:option("inside", { "blocks", "spheres", "balls", "metal", "empty" })

s:view("front", { position = { 0.278, 0.273, -0.8 }, target = { 0.278, 0.273, 0 }, fov = 39.3077 })
s:view("corner", { position = { 0.05, 0.5, 0.06 }, target = { 0.33, 0.14, 0.36 }, fov = 75 })

local white = { 0.725, 0.71, 0.68 }
for _, name in ipairs { "floor", "ceiling", "back_wall" } do s:material(name, { base_color = white }) end
s:material("right_wall", { base_color = { 0.14, 0.45, 0.091 } })
s:material("left_wall", { base_color = { 0.63, 0.065, 0.05 } })
s:material("light", { emission = { 18.4, 15.6, 8.0 }, emitter_reflects = false })
s:import("cornell/room.obj")

if inside == "blocks" then
  s:material("short_block", { base_color = white })
  s:material("tall_block", { base_color = white })
  s:import("cornell/short_block.obj")
  s:import("cornell/tall_block.obj")
elseif inside == "spheres" or inside == "balls" then
  s:material("mirror", { base_color = { 0.95, 0.95, 0.95 }, metallic = 1, roughness = 0 })
  s:material("glass", { opacity = 0, roughness = 0, ior = 1.5 })
  local ball = inside == "spheres" and shape.sphere { radius = 0.1 } or shape.ball { radius = 0.1 }
  s:add { name = "mirror", shape = ball, material = "mirror", at = { 0.4, 0.1, 0.37 } }
  s:add { name = "glass", shape = ball, material = "glass", at = { 0.17, 0.1, 0.19 } }
elseif inside == "metal" then
  s:material("gold", { base_color = { 0.95, 0.73, 0.35 }, metallic = 1, roughness = 0.05 })
  local band = shape.lathe { segments = 256, profile = {
    { 0.13, 0 }, { 0.137, 0.012 }, { 0.139, 0.035 }, { 0.137, 0.058 }, { 0.13, 0.07 }, { 0.126, 0.058 }, { 0.125, 0.035 }, { 0.126, 0.012 }, { 0.13, 0 } } }
  s:add { name = "ring", shape = band, material = "gold", at = { 0.28, 0, 0.25 } }
end

return s
