-- scripts/material_sweep.lua: the effect of each material parameter, on one ball under fixed
-- lights.
--
--     lumbre run scripts/material_sweep.lua
--
-- After thesis S0, section 4.8 and figure 4.10 (docs/bibliography.md): ten parameters in rows, five
-- values in columns. The thesis has a scene file for each picture; here all cells share one scene,
-- and each sets the parameter of its row. Two rows differ from their names:
--   specular   varies the index of refraction of an opaque ball, as in the thesis, whose material
--              has no parameter `specular`;
--   opacity    has an index of refraction close to 1, as in the thesis, so that the ball fades
--              instead of becoming glass.
--
-- Results in out/latest:
--     sheets/materials.svg, .png, .pdf   all pictures, parameters in rows and values in columns
--     runs/**/final.png                  a picture for each parameter and value

local x = experiment("material_sweep", { seed = 4 })

-- For each row: the parameter that varies, its first and last value, and further values that make
-- its effect visible. Colours that hide an effect in the thesis are darker or more saturated here.
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

-- Position between the first (0) and the last (1) value of the parameter.
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

-- The noise at 64 samples is small enough to see the effect of every parameter.
x:stop(stop.samples(64))

x:sheet("materials", { rows = "parameter", cols = "amount" })

return x
