-- scripts/theses/s0_figure_4_10.lua: the parameters of the material model.
--
--     lumbre run scripts/theses/s0_figure_4_10.lua              10 minutes
--     lumbre run scripts/theses/s0_figure_4_10.lua quick=true   10 seconds
--     lumbre run scripts/theses/s0_figure_4_10.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 4.8: figure 4.10, a sphere with ten parameters in rows
-- and five values in columns, by bpt in 1000 s. `folder` has the document's fifty scenes; without
-- it one ball of this project takes all values. As in the document, `specular` varies the index of
-- refraction of an opaque ball, and `opacity` has an index near 1.

local x = experiment("s0_figure_4_10", { seed = 2026 })

-- For each row: folder and name of the document's files; parameter, first and last value, and
-- further values with which its effect is visible.
local gold, white = { 1.0, 0.76, 0.46 }, { 1.0, 1.0, 1.0 }
local rows = {
  subsurface = { "subsurface/subsurface", "subsurface", 0, 1, { base_color = white, roughness = 1 } },
  metallic = { "metallic/metallic", "metallic", 0, 1, { base_color = gold, roughness = 0 } },
  roughness = { "roughness/roughness", "roughness", 0, 1, { base_color = { 0.6, 0.12, 0.05 } } },
  anisotropic = { "anisotropic/anisotropic", "anisotropic", 0, 1, { base_color = gold, roughness = 0.4, metallic = 1 } },
  specular = { "specular/specular", "ior", 1.02, 2, { base_color = { 0.1, 0.25, 0.12 }, roughness = 0 } },
  specular_tint = {
    "specutlarTint/specular", "specular_tint", 0, 1, { base_color = { 0.9, 0.35, 0.1 }, roughness = 0.2, ior = 2 },
  },
  sheen = { "sheen/sheen", "sheen", 0, 1, { base_color = { 0.1, 0.01, 0.01 }, roughness = 1 } },
  sheen_tint = { "sheenTint/sheenTint", "sheen_tint", 0, 1, { base_color = { 0.015, 0.02, 0.1 }, roughness = 1, sheen = 1 } },
  opacity = { "opacity/opacity", "opacity", 0, 1, { base_color = { 0.8, 0.8, 0.8 }, roughness = 0, ior = 1.02 } },
  ior = { "ior/ior", "ior", 1.02, 2, { base_color = white, roughness = 0, opacity = 0 } },
}
local names = {
  "subsurface", "metallic", "roughness", "anisotropic", "specular", "specular_tint", "sheen", "sheen_tint",
  "opacity", "ior",
}
x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("parameter", names)
x:axis("amount", { 0, 0.25, 0.5, 0.75, 1 })

x:render(function(p)
  local file, name, first, last, others = table.unpack(rows[p.parameter])
  local render = { integrator = "nee", max_depth = 5, resolution = p.quick and { 48, 48 } or { 192, 192 } }
  if p.folder ~= "own" then
    local amount = ("%g"):format(p.amount):gsub("%.", "")
    render.scene = ("%s/DisneyTest2/%s%s.scn"):format(p.folder, file, amount)
    return render
  end
  render.scene = "scenes/material_ball/material_ball.scn"
  render.set = { ["materials.ball." .. name] = first + (last - first) * p.amount }
  for other, value in pairs(others) do render.set["materials.ball." .. other] = value end
  return render
end)
x:stop(function(p) return stop.samples(p.quick and 64 or 1024) end)
x:sheet("materials", { rows = "parameter", cols = "amount" })
return x
