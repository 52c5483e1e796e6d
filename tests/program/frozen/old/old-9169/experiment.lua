local x = experiment("old", { seed = 3 })
x:axis("technique", { "bpt", "nee" })
x:axis("depth", { 2, 4 })
x:render(function(p)
  return {
    scene = "ball.scn",
    integrator = p.technique,
    max_depth = p.depth,
    resolution = { 16, 12 },
    aa = { filter = "gauss", radius = 1 },
    rr = { start = 3 },
    films = { "normal" },
    backend = "cpu",
  }
end)
x:reference { from = function(p) return { integrator = "nee" } end, stop = stop.samples(2048) }
x:measure { every = "0.2s", relmse = metric.relmse(), rmse = metric.rmse() }
x:stop(stop.samples(12000))
x:figure("error", { x = "samples", y = { "relmse" }, by = "technique", facet = { "depth" } })
x:table("errors", { value = "relmse", rows = "technique", cols = "depth", format = { "md", "csv" } })
return x
