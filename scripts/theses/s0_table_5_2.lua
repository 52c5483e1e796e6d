-- scripts/theses/s0_table_5_2.lua: sampling rates.
--
--     lumbre run scripts/theses/s0_table_5_2.lua              27 minutes
--     lumbre run scripts/theses/s0_table_5_2.lua quick=true   3 minutes
--     lumbre run scripts/theses/s0_table_5_2.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), sections 5.3.6 and 5.3.7: table 5.2, frames per second of three
-- techniques in eight scenes on two graphics cards, and table 5.3, one card relative to the other.
-- A frame is one sample of every pixel; the document has 1280x720 pixels, so only ratios within a
-- row compare. `lumbre report NIGHT NIGHT` makes table 5.3 of the nights of two machines.
--
-- `nee-document` traces a shadow ray to every lamp, as the document does.

local s0 = require("lib.s0")
local x = experiment("s0_table_5_2", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("stage", {
  "cornell-balls", "cornell-spheres", "bedroom", "veach-lamps", "atrium-sky", "gallery-sky",
  "atrium-lamps", "gallery-lamps",
})
x:axis("technique", { "bpt", "nee", "nee-document", "bdpt" })

x:render(function(p)
  local render = s0.picture(p, p.technique, s0.form(p, { { 320, 180 }, { 160, 90 } }))
  -- The same rays, on devices too; only the weights differ.
  if p.technique == "nee-document" then render.integrator, render.mis = "nee", "none" end
  return render
end)
x:measure { every = "1s", display = s0.display }
x:stop(function(p) return stop.time(s0.form(p, { 10, 0.8 })) end)
x:table("fps", { value = "fps", rows = "stage", cols = "technique" })
x:table("rays", { value = "mrays_s", rows = "stage", cols = "technique" })
return x
