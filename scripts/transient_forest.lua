-- A glade under a flash: leaves cut out by masks, whose chlorophyll glows red two units after it was lit.
--
--     lumbre run scripts/transient_forest.lua
--
-- Figure 6.8 of thesis S2 (docs/bibliography.md), with the forest of this project. The leaves of the scene become composed: the green leaf
-- as it is, and a red one that gives light back late. Grass, bark and soil stay as they are.

local x = experiment("transient_forest", { seed = 2 })

x:axis("width", { 160 })
x:axis("samples", { 128 })

x:render(function(p)
  return {
    scene = "scenes/forest.lua",
    scene_options = { trees = 24, leaves = "chlorophyll" },
    view = "glade",
    integrator = "nee",
    max_depth = 4,
    resolution = { p.width, p.width * 9 // 16 },
    film = { time = { start = 52, bin = 0.4, bins = 150, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
