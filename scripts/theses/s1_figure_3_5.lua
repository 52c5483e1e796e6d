-- scripts/theses/s1_figure_3_5.lua: planes in focus.
--
--     lumbre run scripts/theses/s1_figure_3_5.lua              3 minutes
--     lumbre run scripts/theses/s1_figure_3_5.lua quick=true   2 seconds
--
-- Thesis S1 (docs/bibliography.md), section 3.1: figures 3.2 to 3.5, a scene without a lens, in
-- focus at 10 m and at 30 m. Here: a row of lamps and balls at 1, 2 and 6 m, a lens of 50 mm at
-- f/1.4. Out of focus each lamp becomes an evenly bright disk: for a lens of diameter A and focal
-- length f, a lamp at distance z and a distance d in focus, of diameter A |z - d| / z * f / d on the
-- sensor.

local x = experiment("s1_figure_3_5", { seed = 2026 })

x:axis("quick", { false })
x:axis("focus", { "everywhere", "near", "far" })

local cameras = {
  everywhere = { aperture = 0 },
  near = { f_number = 1.4, focus_distance = 1 },
  far = { f_number = 1.4, focus_distance = 6 },
}
x:render(function(p)
  return {
    scene = "scenes/lamp_row/lamp_row.scn",
    integrator = "nee",
    max_depth = 4,
    resolution = p.quick and { 96, 64 } or { 576, 384 },
    camera = cameras[p.focus],
  }
end)
x:stop(function(p) return stop.samples(p.quick and 64 or 1024) end)
x:sheet("focus", { cols = "focus" })
return x
