-- scripts/veach_pyramid.lua: light that each strategy of bidirectional path tracing finds, before
-- and after its weight.
--
--     lumbre run scripts/veach_pyramid.lua
--
-- After Veach 1997, figure 10.3, and thesis S0, figure 4.13 (docs/bibliography.md). A path of k
-- edges from camera to light can be found by k + 1 strategies, with s vertices from the light and
-- t = k + 1 - s vertices from the camera. The layer "strategies" keeps two films for each strategy.
-- The raw film is the estimate of the strategy alone: strategies of one row that can find all light
-- of their length agree in brightness and differ in noise only. The weighted film is the share of
-- the strategy in the picture; a row adds up to all light of its length.
--
-- Results in out/latest; rows are path lengths k, columns are numbers of light vertices s, and rows
-- are brightened by the factor in their labels:
--     runs/**/films/pyramid-raw.png        every strategy alone
--     runs/**/films/pyramid-weighted.png   with the weights of multiple importance sampling
--     runs/**/films/depths.png             light by path length

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
