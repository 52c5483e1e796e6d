-- Veach's pyramid: what each strategy of bidirectional path tracing finds, before and after its weight.
--
--     lumbre run scripts/veach_pyramid.lua
--
-- After figure 10.3 of Veach's thesis [1997] and figure 4.13 of thesis S0 (docs/bibliography.md). A path of k edges from camera to light
-- can be found in k + 1 ways: by s vertices from the light and t = k + 1 - s from the camera. The layer "strategies"
-- keeps a film for each way, twice. Raw is what the way alone would say: where it could find all light of its length, the
-- films of a row agree in brightness and differ in noise alone. Weighted is its share in the picture, in which the row
-- adds up to the light of its length.
--
-- Look at films/pyramid-raw.png and films/pyramid-weighted.png in each run's folder: rows are path lengths k, columns
-- numbers of light vertices s; rows are brightened as their labels say.

local x = experiment("veach_pyramid", { seed = 1 })

x:axis("scene", { "veach_lamps", "cornell_spheres" })

local sizes = { veach_lamps = { 256, 144 }, cornell_spheres = { 160, 160 } }

x:render(function(p)
  return {
    scene = "scenes/" .. p.scene .. "/" .. p.scene .. ".scn",
    integrator = "bdpt",
    mis = "power",
    max_depth = 5,
    resolution = sizes[p.scene],
    films = { "depth", "strategies", "bounces" },
  }
end)

x:measure { display = tonemap.srgb { exposure = 1 } }
x:stop(stop.any { stop.samples(256), stop.time("40s") })

return x
