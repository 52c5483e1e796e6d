-- scripts/recipes/sweep_aperture.lua: depth of field and its noise, from f/16 to f/1.

local x = experiment("sweep_aperture", { seed = 7 })

x:axis("f_number", { 16, 4, 1 })
x:axis("size", { 128 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/lamp_row/lamp_row.scn",
    integrator = "nee",
    max_depth = 3,
    resolution = { p.size, p.size * 2 // 3 },
    -- Balls stand 1, 2 and 6 m from the camera; a scene unit is a metre.
    camera = { f_number = p.f_number, focus_distance = 2 },
  }
end)

x:reference { stop = function(p) return stop.samples(16 * p.samples) end }

x:measure { every = "10s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 1 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("noise", { x = "f_number", y = "rmse" })
x:table("rmse", { value = "rmse", rows = "f_number" })

return x
