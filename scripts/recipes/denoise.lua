-- scripts/recipes/denoise.lua: a picture as it is, filtered, and by a neural denoiser, the same time for each.

local x = experiment("denoise", { seed = 24, repeats = 3 })

x:axis("denoise", { "none", "atrous", "oidn" })
x:axis("size", { 128 })
x:axis("seconds", { 4 })
x:axis("reference", { 2048 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = "nee",
    max_depth = 6,
    resolution = { p.size, p.size },
    denoise = p.denoise,
  }
end)

-- A reference inherits no denoiser.
x:reference { stop = function(p) return stop.samples(p.reference) end }

x:measure { every = "0.25s", relmse = metric.relmse(), flip = metric.flip(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = { "relmse", "flip" }, by = "denoise" })
x:table("relmse", { value = "relmse", rows = "denoise" })
x:table("flip", { value = "flip", rows = "denoise" })

return x
