-- scripts/theses/s2_figure_6_8.lua: a forest of leaves of chlorophyll.
--
--     lumbre run scripts/theses/s2_figure_6_8.lua              3 minutes
--     lumbre run scripts/theses/s2_figure_6_8.lua quick=true   10 seconds
--
-- Thesis S2 (docs/bibliography.md), section 6.2.4: figure 6.8, a forest whose leaves re-emit red
-- light after 2, while trunks and animals do not. Here: a forest of this project, with such leaves
-- and with plain ones, whose light has no delay.

local x = experiment("s2_figure_6_8", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("leaves", { "plain", "chlorophyll" })

x:render(function(p)
  return {
    scene = "scenes/forest.lua",
    scene_options = { trees = 24, leaves = p.leaves },
    view = "crown",
    integrator = "nee",
    max_depth = 4,
    resolution = p.quick and { 64, 36 } or { 192, 108 },
    -- The sun alone is the flash: light of the sky comes from all sides at all times.
    set = { ["environment.scale"] = 0 },
    film = { time = { start = 45, bin = 0.25, bins = 140, camera = false, metres = 1 } },
  }
end)
x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.quick and 128 or 1024) end)
x:frames("forest", { rows = "leaves", at = { 57, 58, 59, 60, 61, 62 }, static = true })
return x
