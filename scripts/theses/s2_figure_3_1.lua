-- scripts/theses/s2_figure_3_1.lua: delays that are drawn, and their densities.
--
--     lumbre run scripts/theses/s2_figure_3_1.lua              1 minute
--     lumbre run scripts/theses/s2_figure_3_1.lua quick=true   5 seconds
--
-- Thesis S2 (docs/bibliography.md), sections 3.2.1 and 3.4: table 3.1 (the profiles), figure 3.1
-- (densities, and histograms of 100000 delays drawn by inversion) and figure 3.3 (a composed
-- profile). The document draws numbers; here a flash lights a small plate, so that the light over
-- time is the density of the plate's delay. Its Epanechnikov density lacks 1 / sigma, with which it
-- integrates to one. Histograms: runs/**/films/time-curve.svg.

local x = experiment("s2_figure_3_1", { seed = 2026, repeats = 5 })

local profiles = {
  none = {},
  constant = { delay = "constant", delay_constant = 1 },
  exponential = { delay = "exponential", delay_rate = 2 },
  epanechnikov = { delay = "epanechnikov", delay_mean = 1, delay_width = 0.5 },
}
x:axis("quick", { false })
x:axis("profile", { "none", "constant", "exponential", "epanechnikov", "composed" })

x:render(function(p)
  local set = {}
  for name, value in pairs(profiles[p.profile] or {}) do set["materials.plate." .. name] = value end
  return {
    scene = "scripts/theses/scenes/flash.lua",
    scene_options = { composed = p.profile == "composed" },
    integrator = "nee",
    max_depth = 2,
    resolution = { 16, 16 },
    set = set,
    film = { time = { start = 1, bin = 0.025, bins = 320, camera = false, metres = 1 } },
  }
end)
x:measure { every = "5s" }
x:stop(function(p) return stop.samples(p.quick and 400 or 4000) end)
x:frames("densities", { at = { 1.125, 1.5, 2.125, 2.5 }, rows = "profile", density = "plate" })
return x
