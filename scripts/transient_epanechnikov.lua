-- A hare that gives light back with Epanechnikov's profile, which is a parabola of mean mu and half extent sigma.
--
--     lumbre run scripts/transient_epanechnikov.lua
--     lumbre run scripts/transient_epanechnikov.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.4 of thesis S2 (docs/bibliography.md): (0.5, 0.1) is nearly a constant delay, (0.5, 0.5) spreads it, (0.1, 0.1) is nearly none.
-- Its density is 3 / (4 sigma) (1 - ((x - mu) / sigma)^2); the source leaves out the sigma under the line.

local x = experiment("transient_epanechnikov", { seed = 2 })

x:axis({ "mu", "sigma" }, zip({ 0.5, 0.5, 0.1 }, { 0.1, 0.5, 0.1 }))
x:axis("model", { "hare" })
x:axis("size", { 96 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { bunny = p.model ~= "hare" and p.model or "" },
    view = "front",
    integrator = "nee",
    resolution = { p.size, p.size },
    set = {
      ["materials.hare.delay"] = "epanechnikov",
      ["materials.hare.delay_mean"] = p.mu,
      ["materials.hare.delay_width"] = p.sigma,
    },
    film = { time = { start = 3.5, bin = 0.05, bins = 170, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
