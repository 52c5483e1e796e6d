-- scripts/recipes/ci_for_your_renderer.lua: pictures with their noise, in place of your renderer's.

local x = experiment("ci_for_your_renderer", { seed = 23 })

x:axis("picture", { "golden", "today", "changed" })
x:axis("size", { 64 })
x:axis("samples", { 256 })

x:render(function(p)
  -- A lamp that is 1 % too bright.
  local lamp = p.picture == "changed" and { 18.584, 15.756, 8.08 } or { 18.4, 15.6, 8.0 }
  return {
    scene = "scenes/cornell.lua",
    -- Two techniques have no samples in common; with 16 times the samples, they have equal noise.
    integrator = p.picture == "golden" and "nee" or "bdpt",
    set = { ["materials.light.emission"] = lamp },
    max_depth = 5,
    resolution = { p.size, p.size },
  }
end)

-- References come with the standard error of each pixel.
x:reference {
  stop = function(p) return stop.samples((p.picture == "golden" and 16 or 1) * p.samples) end,
}

x:measure { rmse = metric.rmse() }
x:stop(stop.samples(1))

return x
