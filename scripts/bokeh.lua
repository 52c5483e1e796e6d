-- scripts/bokeh.lua: how the f-number and the focus distance change a picture, and its cost.
--
--     lumbre run scripts/bokeh.lua
--
-- After thesis S0, section 4.4.1 and figure 4.6, a picture with and without a lens, and thesis S1,
-- section 3.1 and figures 3.2 to 3.5, which move the plane in focus (docs/bibliography.md). The
-- scene has small lamps. Out of focus each becomes an evenly bright disk, an image of the lens. For
-- a lens of diameter A = f / N and a lamp at distance z with distance d in focus, the diameter of
-- the disk on the sensor is A |z - d| / z * f / d.
--
-- From f/16 to f/1 the disks grow. With the focus distance the sharp ball and the sharp lamps move
-- from the front to the back. The noise is that of the disks: a pixel in a disk receives light from
-- its lamp through a small part of the lens, and only from a part of its own area if the lamp's
-- image is smaller than a pixel. The table shows whether the Sobol sequence reduces this noise,
-- which depends on lens and pixel position together: it does, at f/2.8 by a sixth. `bdpt` can also
-- find such light by paths that start at the lamps and are connected to the lens.
--
-- Results in out/latest:
--     runs/**/final.png       a picture for each f-number, focus distance and sampler
--     figures/convergence_*   RMSE against samples by sampler, for each f-number and focus distance
--     tables/rmse             final RMSE by f-number, focus distance and sampler
--     tables/time             render time in seconds, in the same order

local x = experiment("bokeh", { seed = 44 })

-- The balls are at 1, 2 and 6 m from the camera; focus distances are in metres.
x:axis("f_number", { 16, 2.8, 1 })
x:axis("focus", { 1, 2, 6 })
x:axis("sampler", { "independent", "sobol" })

x:render(function(p)
  return {
    scene = "scenes/lamp_row/lamp_row.scn",
    integrator = "nee",
    max_depth = 3,
    resolution = { 168, 112 },
    aa = { filter = "tent", radius = 1 },
    camera = { f_number = p.f_number, focus_distance = p.focus },
    sampler = p.sampler,
  }
end)

-- The reference has the lens of its cell. Both samplers share it.
x:reference {
  from = function(p) return { sampler = "sobol" } end,
  stop = stop.samples(256),
}

local display = tonemap.srgb { exposure = 1 }
x:measure { every = "0.5s", rmse = metric.rmse(), display = display }
x:stop(stop.samples(64))

x:figure("convergence", { x = "samples", y = "rmse", by = "sampler", facet = { "f_number", "focus" } })
x:table("rmse", { value = "rmse", rows = { "f_number", "focus" }, cols = "sampler" })
x:table("time", { value = "render_s", rows = { "f_number", "focus" }, cols = "sampler" })

return x
