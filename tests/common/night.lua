local x = experiment("night", { seed = 7, repeats = 2 })
x:axis("depth", { 2, 4 })
x:render(function(p)
  return { scene = "ball.scn", integrator = "bpt", max_depth = p.depth, resolution = { 24, 16 }, backend = "mock" }
end)
x:reference { from = function(p) return { integrator = "bpt" } end, stop = stop.samples(4096) }
x:measure { every = "1s", rmse = metric.rmse(), psnr = metric.psnr(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(16) end)
x:figure("convergence", { x = "samples", y = { "rmse" }, facet = { "depth" } })
x:table("errors", { value = "rmse", rows = "depth", format = { "md", "csv" } })
return x
