-- scripts/transient_forest.lua: a glade under a flash, whose leaves re-emit red light after a delay
-- of two units of optical length.
--
--     lumbre run scripts/transient_forest.lua
--
-- Thesis S2, figure 6.8 (docs/bibliography.md), with a forest of this project. The leaves are cut
-- out by masks. Their material is composed of the green leaf, without a delay, and a red one with
-- the delay. Grass, bark and soil have no delay.
--
-- Results in out/latest:
--     runs/**/films/time-*    frames, animation, streaks and curves over optical length
--     runs/**/final.png       the picture without time

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
