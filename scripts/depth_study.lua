-- scripts/depth_study.lua: how much light paths of each length contribute, how well two techniques
-- find it, and what a larger maximum depth costs.
--
--     lumbre run scripts/depth_study.lua
--
-- After thesis S0, figures 5.6 and 5.7 (docs/bibliography.md), which render the scene of Veach with
-- at most 5, 7 and 10 path edges and show that longer paths brighten the picture and add colour
-- bleeding between walls. Here the layer "depth" shows by how much: it holds the light of each path
-- length. The lamps hide their bulbs, so paths of one edge contribute nothing, and paths of two
-- edges a patch of the ceiling and the lit table. The rest of the room is visible from three edges
-- on, and the egg, which is of glass, from four and five on.
--
-- The layers of one technique at one maximum depth contain the pictures of all smaller depths, as
-- partial sums. The layer "bounces" is the mean number of bounces of the light in a pixel, and
-- "rays" the number of rays per sample, like the heat map of thesis S1, figure 2.4.
--
-- Results in out/latest:
--     runs/**/films/depths.png   light by path length on one sheet; labels state the brightening
--     runs/**/films/{bounces,rays}.png
--                                mean number of bounces, and rays per sample
--     figures/convergence_*      RMSE and SSIM against render time by depth, for each technique
--     tables/rmse                final RMSE by depth and technique
--     tables/samples             samples per pixel, in the same order

local x = experiment("depth_study", { seed = 1, repeats = 3 })

x:axis("technique", { "bpt", "nee" })
x:axis("depth", { 5, 7, 10 })

x:render(function(p)
  return {
    scene = "scenes/veach_lamps/veach_lamps.scn",
    integrator = p.technique,
    max_depth = p.depth,
    resolution = { 256, 144 },
    films = { "depth", "bounces", "rays" },
  }
end)

-- One reference per depth, by the technique that converges fastest. References keep no layers.
x:reference { from = function(p) return { integrator = "bdpt" } end, stop = stop.time("8s") }

local display = tonemap.srgb { exposure = 1 }
x:measure {
  every = "0.5s",
  rmse = metric.rmse(),
  ssim = metric.ssim { on = display, range = 1 },
  display = display,
}

-- Equal time, as in thesis S0.
x:stop(stop.time("8s"))

x:figure("convergence", { x = "render_s", y = { "rmse", "ssim" }, by = "depth", facet = "technique" })
x:table("rmse", { value = "rmse", rows = "depth", cols = "technique" })
x:table("samples", { value = "samples", rows = "depth", cols = "technique" })

return x
