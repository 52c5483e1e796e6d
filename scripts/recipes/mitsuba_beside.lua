-- scripts/recipes/mitsuba_beside.lua: Lumbre and Mitsuba 3, measured against the same reference.

local x = experiment("mitsuba_beside", { seed = 16 })

x:axis("technique", { "nee", "bdpt", "external:mitsuba" })
x:axis("python", { "python3" })
x:axis("size", { 96 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = p.technique,
    -- The interpreter that has the package `mitsuba`.
    python = p.technique == "external:mitsuba" and p.python or nil,
    max_depth = 6,
    resolution = { p.size, p.size },
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(8 * p.samples) end,
}

x:measure { every = "1s", rmse = metric.rmse(), flip = metric.flip(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = { "rmse", "flip" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("seconds", { value = "render_s", rows = "technique" })

return x
