-- scripts/transient_epanechnikov.lua: a hare that re-emits light with the Epanechnikov profile, a
-- parabola with mean mu and half width sigma in units of optical length.
--
--     lumbre run scripts/transient_epanechnikov.lua
--     lumbre run scripts/transient_epanechnikov.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.4 (docs/bibliography.md): (mu, sigma) = (0.5, 0.1) is nearly a constant
-- delay, (0.5, 0.5) spreads the light, and (0.1, 0.1) is nearly no delay. The density is
-- 3 / (4 sigma) (1 - ((x - mu) / sigma)^2). The thesis omits the factor 1 / sigma.
--
-- Results in out/latest:
--     sheets/delays.*         density, picture without time, and frames of each profile
--     runs/**/films/time-*    frames, animation, streaks and curves over optical length
--     runs/**/final.png       the picture without time

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

x:frames("delays", {
  rows = { "mu", "sigma" },
  at = { 4.5, 5.5, 6.5, 7.5, 8.5 },
  density = "hare",
  static = true,
})

return x
