-- scripts/theses/s0_section_5_1_3.lua: what an SSIM of 0.95 means.
--
--     lumbre run scripts/theses/s0_section_5_1_3.lua              10 minutes
--     lumbre run scripts/theses/s0_section_5_1_3.lua quick=true   80 seconds
--     lumbre run scripts/theses/s0_section_5_1_3.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 5.1.3, defines SSIM, whose constants depend on the
-- range of the pictures, and section 5.3 states that metrics do not see the gamma of 2.2. Its bpt
-- takes 30 s at 663 frames a second to an SSIM of 0.95 in the box: 20000 frames. How many frames it
-- takes depends on what is compared: `ssim` pictures as displayed, as the first published program
-- of analysis does; `linear` radiance with a range of 1; `range` radiance with that of the light,
-- as the second program does. With a light of radiance 1 instead of 10, as the box is published,
-- the first two need fewer.

local s0 = require("lib.s0")
local x = experiment("s0_section_5_1_3", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("stage", { "cornell-spheres" })
x:axis("light", { 10, 1 })

x:render(function(p)
  local render = s0.picture(p, "bpt", s0.form(p, { { 160, 90 }, { 64, 36 } }))
  render.set = { ["materials.light.emission"] = { p.light, p.light, p.light } }
  return render
end)
x:reference {
  from = function(p) return { integrator = "bdpt" } end,
  stop = function(p) return stop.time(s0.form(p, { 120, 20 })) end,
}
x:measure {
  every = "0.05s",
  display = tonemap.gamma { gamma = 2.2 },
  ssim = metric.ssim { on = s0.display },
  linear = metric.ssim { range = 1 },
  range = metric.ssim { range = 10 },
}
x:stop(function(p) return stop.time(s0.form(p, { 40, 4 })) end)
x:figure("frames", { x = "samples", y = { "ssim", "linear", "range" }, by = "light" })
return x
