-- scripts/recipes/check_bias.lua: is the integrator `bdpt` biased in this scene?

local x = experiment("check_bias", { seed = 4 })

-- omit=true leaves one strategy of bdpt out, which makes it biased on purpose.
x:axis("omit", { false })
x:axis("size", { 64 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = "bdpt",
    strategies = p.omit and { 1, 3 } or nil,
    contribution = not p.omit,
    max_depth = 5,
    resolution = { p.size, p.size },
  }
end)

-- The integrator under test renders the reference; `nee` renders the same picture beside it.
x:reference {
  stop = function(p) return stop.samples(16 * p.samples) end,
  agree = { with = "nee" },
}

x:measure { rmse = metric.rmse() }
x:stop(function(p) return stop.samples(p.samples) end)

return x
