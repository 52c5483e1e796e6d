-- How much light paths of each length bring, how well two techniques find it, and what a longer limit costs.
--
--     lumbre run scripts/depth_study.lua
--
-- After the depth study of thesis S0 (docs/bibliography.md), its figures 5.6 and 5.7: the lamps of Veach with a limit of 5, 7 and 10
-- edges. There, longer paths were seen to brighten the picture and to let walls colour one another. Here the layer
-- "depth" shows by how much: it keeps the light of each path length apart, and films/depths.png shows them in one row,
-- brightened as their labels say. The lamps hide their bulbs in shades: one edge brings nothing, two a patch of ceiling and the lit
-- table, and the room is there from three on. The egg is glass and is seen from four and five on.
--
-- The films of one technique at one limit already hold the pictures of all smaller limits: they are the partial sums.
-- "bounces" is how often the light of a pixel has bounced in the mean, and "rays" what a sample of the pixel costs, the
-- heat map of the second source's figure 2.4.

local x = experiment("depth_study", { seed = 1 })

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

-- The truth of each limit, by the technique that finds it sooner. A reference keeps no films.
x:reference { from = function(p) return { integrator = "bdpt" } end, stop = stop.time("8s") }

local display = tonemap.srgb { exposure = 1 }
x:measure {
  every = "0.5s",
  rmse = metric.rmse(),
  ssim = metric.ssim { on = display, range = 1 },
  display = display,
}

-- Equal time, as in the source.
x:stop(stop.time("8s"))

x:figure("convergence", { x = "render_s", y = { "rmse", "ssim" }, by = "depth", facet = "technique" })
x:table("rmse", { value = "rmse", rows = "depth", cols = "technique" })
x:table("samples", { value = "samples", rows = "depth", cols = "technique" })

return x
