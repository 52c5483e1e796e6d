-- scripts/recipes/light_in_flight.lua: light with a finite speed, and a material with a delay.

local x = experiment("light_in_flight", { seed = 19 })

-- Delay of the hare's material in units of optical length; 0 is none.
x:axis("delay", { 0, 1 })
x:axis("size", { 64 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/hare_box.lua",
    view = "front",
    integrator = "nee",
    resolution = { p.size, p.size },
    set = { ["materials.hare.delay"] = "constant", ["materials.hare.delay_constant"] = p.delay },
    -- 80 bins of 0.1 units from 3.5 on; `metres` adds seconds to labels.
    film = { time = { start = 3.5, bin = 0.1, bins = 80, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:frames("delays", { at = { 4.5, 5.5, 6.5, 7.5 }, density = "hare", static = true })

return x
