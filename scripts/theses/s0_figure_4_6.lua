-- scripts/theses/s0_figure_4_6.lua: depth of field.
--
--     lumbre run scripts/theses/s0_figure_4_6.lua              4 minutes
--     lumbre run scripts/theses/s0_figure_4_6.lua quick=true   2 seconds
--     lumbre run scripts/theses/s0_figure_4_6.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 4.4.1: figure 4.6, a scene without and with a lens.
-- `folder` has the document's scene; a row of lamps replaces it. The document places points on the
-- lens with more light near its middle, equation (4.8); here they are uniform.

local x = experiment("s0_figure_4_6", { seed = 2026 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("lens", { "without", "with" })

x:render(function(p)
  local own = p.folder == "own"
  return {
    scene = own and "scenes/lamp_row/lamp_row.scn" or p.folder .. "/DOF/monos.scn",
    integrator = "nee",
    max_depth = 5,
    resolution = p.quick and { 96, 64 } or { 768, 512 },
    camera = { aperture = p.lens == "without" and 0 or own and 0.036 or 0.06, focus_distance = own and 2 or 1 },
  }
end)
x:stop(function(p) return stop.samples(p.quick and 64 or 1024) end)
x:sheet("lens", { cols = "lens" })
return x
