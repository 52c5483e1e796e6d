-- scripts/theses/s0_figure_5_21.lua: light through and from the egg, by each technique.
--
--     lumbre run scripts/theses/s0_figure_5_21.lua              10 minutes
--     lumbre run scripts/theses/s0_figure_5_21.lua quick=true   30 seconds
--
-- Thesis S0 (docs/bibliography.md), section 5.4.3: figure 5.21, the picture by `bdpt` with more
-- exposure, whose egg is too dark, and lacks the reflection of the right lamp. The document blames
-- its weights (figure 4.14). Here the techniques render the table from near by, with ten path
-- edges; the mean radiance of the picture must not depend on the technique.

local s0 = require("lib.s0")
local x = experiment("s0_figure_5_21", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("technique", { "bpt", "nee", "bdpt" })

x:render(function(p)
  return {
    scene = "scenes/veach_lamps.lua",
    view = "table",
    integrator = p.technique,
    max_depth = 10,
    resolution = s0.form(p, { { 320, 180 }, { 96, 54 } }),
  }
end)
x:measure { every = "5s", display = tonemap.gamma { gamma = 2.2, exposure = 1 } }
x:stop(function(p) return stop.time(s0.form(p, { 40, 2 })) end)
x:sheet("table", { cols = "technique" })
return x
