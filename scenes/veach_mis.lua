-- Plates of increasing roughness under lights of increasing size: a test of multiple importance
-- sampling (MIS).
--
-- After Veach 1997, figure 9.2. Light sampling works well for small lights, and BSDF sampling for
-- sharp highlights. Between these cases neither alone works well; MIS covers all of them. The
-- lights have equal power, so the smallest has the highest radiance.

local s = scene { resolution = { 768, 512 }, max_depth = 5 }

s:view("plates", { position = { 0, 2, 15 }, target = { 0, -2, 2.5 }, fov = 28 })
s:view("smoothest", { position = { 0, 0, 11 }, target = { 0, -3.7, 3.5 }, fov = 34 })

s:material("wall", { base_color = { 0.4, 0.4, 0.4 }, model = "lambert" })
s:add { name = "floor", shape = shape.grid { size = { 80, 60 } }, material = "wall", at = { 0, -4.5, 0 } }
s:add { name = "back", shape = shape.grid { size = { 80, 60 } }, material = "wall", at = { 0, 0, -3 }, rotate = { 90, 0, 0 } }

-- Each plate is tilted so that its centre reflects the lights into the camera.
local plates = { { 0.07, -4.0, 3.7 }, { 0.14, -3.45, 2.4 }, { 0.22, -2.8, 1.4 }, { 0.32, -1.9, 0.4 } }
local lamps_at, eye = { 0, 0, 0 }, { 0, 2, 15 }
for i, plate in ipairs(plates) do
  local roughness, y, z = plate[1], plate[2], plate[3]
  local function toward(p)
    local dy, dz = p[2] - y, p[3] - z
    local length = math.sqrt(dy * dy + dz * dz)
    return dy / length, dz / length
  end
  local ay, az = toward(lamps_at)
  local by, bz = toward(eye)
  local lean = math.deg(math.atan(az + bz, ay + by))
  s:material("plate_" .. i, { base_color = { 0.35, 0.35, 0.35 }, metallic = 1, roughness = roughness })
  s:add {
    name = "plate_" .. i,
    shape = shape.box { size = { 8, 0.1, 1.1 } },
    material = "plate_" .. i,
    at = { 0, y, z },
    rotate = { lean, 0, 0 },
  }
end

-- Four lights of the same power: radiance is inversely proportional to the area.
local tints = { { 1, 0.55, 0.4 }, { 1, 0.85, 0.45 }, { 0.55, 1, 0.6 }, { 0.5, 0.7, 1 } }
for i, radius in ipairs { 0.033, 0.1, 0.3, 0.9 } do
  local radiance = 3 / (radius * radius)
  local tint = tints[i]
  s:material("lamp_" .. i, { emission = { radiance * tint[1], radiance * tint[2], radiance * tint[3] }, base_color = { 0, 0, 0 } })
  s:add {
    name = "lamp_" .. i,
    shape = shape.sphere { radius = radius },
    material = "lamp_" .. i,
    at = { -3.75 + 2.5 * (i - 1), 0, 0 },
  }
end

-- A weak light from above makes the plates visible.
s:material("above", { emission = { 6, 6, 6 }, base_color = { 0, 0, 0 } })
s:add { name = "above", shape = shape.sphere { radius = 0.5 }, material = "above", at = { 0, 10, 6 } }

return s
