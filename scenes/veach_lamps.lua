-- A room lit by two enclosed lamps: one lights the ceiling, the other a table with a glass egg.
--
-- After the scene of Veach 1997, chapter 10, which thesis S0 uses as well (docs/bibliography.md).
-- Nearly all light is indirect, and light through the egg forms a caustic. Meshes and lights are
-- those of veach_lamps/veach_lamps.scn. Option `egg`: the material of the egg.

local s = scene { resolution = { 1280, 720 }, max_depth = 9 }
local egg = s:option("egg", { "glass", "frosted", "steel", "clay" })

s:view("room", { position = { -0.1, 1.4, 2.25 }, target = { 0, 1.1, -0.6 }, fov = 40 })
s:view("table", { position = { 0.55, 1.25, 0.95 }, target = { 0.1, 0.78, -0.1 }, fov = 36 })

local kinds = {
  glass = { base_color = { 1, 1, 1 }, opacity = 0, roughness = 0, ior = 1.5 },
  frosted = { base_color = { 1, 1, 1 }, opacity = 0, roughness = 0.3, ior = 1.5 },
  steel = { base_color = { 0.75, 0.75, 0.78 }, metallic = 1, roughness = 0.15 },
  clay = { base_color = { 0.7, 0.5, 0.4 }, roughness = 1 },
}
s:material("egg", kinds[egg])
s:material("walls", { base_color = { 0.6, 0.58, 0.55 } })
s:material("ceiling", { base_color = { 0.75, 0.75, 0.75 } })
s:material("floor", { base_color = { 0.3, 0.22, 0.15 } })
s:material("wood", { base_color = { 0.55, 0.38, 0.22 } })
s:material("lamp", { base_color = { 0.5, 0.5, 0.5 } })
s:material("floor_light", { emission = { 1000, 850, 600 }, emitter_reflects = false })
s:material("spot_light", { emission = { 800, 760, 680 }, emitter_reflects = false })

for name, place in pairs {
  room = { 0, 0, 0 },
  table = { 0.1, 0, -0.1 },
  egg = { 0.1, 0.7402, -0.1 },
  floor_lamp = { -1.2, 0, -1.05 },
  spot_lamp = { 0, 0, 0 },
} do
  s:import("veach_lamps/" .. name .. ".obj", { place = { at = place } })
end

return s
