-- scripts/recipes/pixel_filters.lua: filters and radii at edges of high contrast.

local x = experiment("pixel_filters", { seed = 12 })

-- Axes that move together. Radii are half widths in pixels; a box of 0.5 is the pixel itself.
x:axis({ "filter", "radius" }, zip(
  { "box", "box", "tent", "gauss", "blackman_harris" },
  { 0, 0.5, 1, 1.5, 2 }
))
x:axis("size", { 96 })
x:axis("samples", { 32 })

x:render(function(p)
  return {
    scene = "scenes/edges/edges.scn",
    integrator = "bpt",
    max_depth = 1,
    resolution = { p.size, p.size },
    aa = { filter = p.filter, radius = p.radius },
  }
end)

-- The reference inherits the cell's filter, so the error is noise alone and not blur.
x:reference { stop = function(p) return stop.samples(16 * p.samples) end }

x:measure { every = "10s", rmse = metric.rmse() }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("rmse", { value = "rmse", rows = { "filter", "radius" } })

return x
