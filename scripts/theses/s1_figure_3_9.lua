-- scripts/theses/s1_figure_3_9.lua: a normal map.
--
--     lumbre run scripts/theses/s1_figure_3_9.lua              1 minute
--     lumbre run scripts/theses/s1_figure_3_9.lua quick=true   10 seconds
--
-- Thesis S1 (docs/bibliography.md), section 3.2.4: figures 3.9 and 3.10, a sphere whose relief is a
-- normal map, and the map. The document adds detail that way without the cost of more triangles.
-- Here: a sphere with a painted map, with its slopes and without them.

local x = experiment("s1_figure_3_9", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("strength", { 0, 1 })

x:render(function(p)
  return {
    scene = "scripts/theses/scenes/relief.lua",
    integrator = "nee",
    max_depth = 4,
    resolution = p.quick and { 96, 96 } or { 256, 256 },
    set = { ["materials.relief.normal_strength"] = p.strength },
  }
end)
x:measure { every = "1s", display = tonemap.srgb() }
x:stop(function(p) return stop.samples(p.quick and 128 or 512) end)
x:table("rate", { value = "mpaths_s", rows = "strength" })
x:sheet("sphere", { cols = "strength" })
return x
