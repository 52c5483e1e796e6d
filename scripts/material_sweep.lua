-- Material sweep: what each parameter of the material does, on one ball in one light.
--
--     lumbre run scripts/material_sweep.lua
--
-- After figure 4.10 of "Codificación de algoritmos de trazado de rayos en Vulkan" (section 4.8): ten parameters in rows,
-- five values in columns. There every picture has a scene file of its own; here there is one scene, and each cell sets
-- what its row varies. Two rows need a word:
--   specular   is the index of refraction of an opaque ball, as in the source, which has no parameter `specular`;
--   opacity    is shown at an index close to 1, as in the source, so that the ball fades instead of turning to glass.

local x = experiment("material_sweep", { seed = 4 })

-- What a row shows: the parameter that varies, its first and last value, and what else must be set for it to show. Where
-- the source's colours hide an effect, those here are darker or more saturated.
local gold = { 1.0, 0.76, 0.46 }
local white = { 1.0, 1.0, 1.0 }
local rows = {
  subsurface = { "subsurface", 0, 1, { base_color = white, roughness = 1.0 } },
  metallic = { "metallic", 0, 1, { base_color = gold, roughness = 0.0 } },
  roughness = { "roughness", 0, 1, { base_color = { 0.6, 0.12, 0.05 } } },
  anisotropic = { "anisotropic", 0, 1, { base_color = gold, roughness = 0.4, metallic = 1.0 } },
  specular = { "ior", 1.02, 2, { base_color = { 0.1, 0.25, 0.12 }, roughness = 0.0 } },
  specular_tint = { "specular_tint", 0, 1, { base_color = { 0.9, 0.35, 0.1 }, roughness = 0.2, ior = 2.0 } },
  sheen = { "sheen", 0, 1, { base_color = { 0.1, 0.01, 0.01 }, roughness = 1.0 } },
  sheen_tint = { "sheen_tint", 0, 1, { base_color = { 0.015, 0.02, 0.1 }, roughness = 1.0, sheen = 1.0 } },
  opacity = { "opacity", 0, 1, { base_color = { 0.8, 0.8, 0.8 }, roughness = 0.0, ior = 1.02 } },
  ior = { "ior", 1.02, 2, { base_color = white, roughness = 0.0, opacity = 0.0 } },
}

x:axis("parameter", {
  "subsurface", "metallic", "roughness", "anisotropic", "specular",
  "specular_tint", "sheen", "sheen_tint", "opacity", "ior",
})

-- How far between its first and last value the parameter is.
x:axis("amount", { 0, 0.25, 0.5, 0.75, 1 })

x:render(function(p)
  local name, first, last, others = table.unpack(rows[p.parameter])
  local set = { ["materials.ball." .. name] = first + (last - first) * p.amount }
  for other, value in pairs(others) do
    set["materials.ball." .. other] = value
  end
  return {
    scene = "scenes/material_ball/material_ball.scn",
    integrator = "nee",
    resolution = { 112, 112 },
    set = set,
  }
end)

-- Fifty small pictures: the noise that is left at 64 samples does not hide what a parameter does.
x:stop(stop.samples(64))

return x
