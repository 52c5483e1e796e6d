-- scripts/theses/s1_figure_3_8.lua: cost of filtering textures.
--
--     lumbre run scripts/theses/s1_figure_3_8.lua              4 minutes
--     lumbre run scripts/theses/s1_figure_3_8.lua quick=true   20 seconds
--
-- Thesis S1 (docs/bibliography.md), section 3.2.3: figure 3.8, thousand paths a second with
-- bilinear filtering (15965) and without (16093), 0.8 % more. Here: a view close to a textured
-- floor. Rates that differ by a per cent need an idle machine.

local x = experiment("s1_figure_3_8", { seed = 2026, repeats = 10 })

x:axis("quick", { false })
x:axis("filter", { "bilinear", "nearest" })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    view = "floor",
    integrator = "bpt",
    max_depth = 5,
    resolution = { 256, 192 },
    set = { ["materials.*.texture_filter"] = p.filter },
  }
end)
x:measure { every = "1s" }
x:stop(function(p) return stop.time(p.quick and 1 or 10) end)
x:table("rate", { value = "mpaths_s", rows = "filter" })
x:sheet("floor", { cols = "filter" })
return x
