-- scripts/theses/s1_figure_3_16.lua: albedo, roughness and metallic.
--
--     lumbre run scripts/theses/s1_figure_3_16.lua              3 minutes
--     lumbre run scripts/theses/s1_figure_3_16.lua quick=true   5 seconds
--
-- Thesis S1 (docs/bibliography.md), section 3.4: figure 3.16, spheres with three parameters in
-- rows; the document's roughness falls from left to right.

local x = experiment("s1_figure_3_16", { seed = 2026 })

x:axis("quick", { false })
x:axis("parameter", { "albedo", "roughness", "metallic" })
x:axis("amount", { 0, 0.25, 0.5, 0.75, 1 })

local red = { 0.7, 0.1, 0.08 }
local function ball(p)
  if p.parameter == "albedo" then
    local a = p.amount
    return { base_color = { 0.7 - 0.6 * a, 0.1 + 0.2 * a, 0.08 + 0.62 * a }, roughness = 0.4 }
  elseif p.parameter == "roughness" then
    return { base_color = red, roughness = 1 - p.amount }
  end
  return { base_color = red, roughness = 0.3, metallic = p.amount }
end
x:render(function(p)
  local set = {}
  for name, value in pairs(ball(p)) do set["materials.ball." .. name] = value end
  return {
    scene = "scenes/material_ball.lua",
    integrator = "nee",
    max_depth = 5,
    resolution = p.quick and { 48, 48 } or { 192, 192 },
    set = set,
  }
end)
x:stop(function(p) return stop.samples(p.quick and 64 or 1024) end)
x:sheet("materials", { rows = "parameter", cols = "amount" })
return x
