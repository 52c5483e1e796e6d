-- Bokeh: what the f-number and the distance in focus do to a picture, and what they cost.
--
--     lumbre run scripts/bokeh.lua
--
-- After the depth of field of the sources: figure 4.6 of the first one (4.4.1), a picture with and without a lens, and
-- figures 3.2 to 3.5 of the second one (3.1), which move the plane in focus. Small lamps show best what happens: out of
-- focus each becomes an image of the lens, an evenly bright disk whose diameter on the sensor is, for a lens of diameter
-- A = f / N and a lamp at distance z from it while d is in focus, A |z - d| / z * f / d.
--
-- Look at the pictures under out/: from f/16 to f/1 the disks grow, and with the focus the sharp ball and the sharp lamps
-- move from the front to the back. The noise is that of the disks: a pixel inside one finds its lamp through a small part
-- of the lens, and of its own area too where the lamp's image is smaller than a pixel. Whether the Sobol sequence helps
-- against such products of two decisions is a question to the table: when this was written it did at f/16, where little
-- is blurred, and did not at f/2.8 and f/1, with one seed each. Paths that start at the lamps and are joined to the lens
-- (integrator = "bdpt") go about it from the other side.

local x = experiment("bokeh", { seed = 44 })

-- The balls stand at 1, 2 and 6 m.
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
    -- Sobol's paths go one by one, and so do the others, or times would compare that.
    accel = { lanes = "never" },
  }
end)

-- The same lens with more samples; one for both samplers.
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
