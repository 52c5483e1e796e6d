-- scripts/report_tour.lua: a small night that contains everything that `lumbre report` draws.
--
--     lumbre run scripts/report_tour.lua
--     lumbre report out/latest
--
-- Three techniques, each repeated three times with different seeds, render a box with a mirror and
-- a glass sphere, and a room in which most light is indirect. Repeats give curves their confidence
-- bands and tables their significance. Snapshots at powers of two samples allow crops at equal time
-- and at equal error. Layers show the light by strategy and depth, and the number of bounces.
--
-- Results: out/latest/report/index.html, with its figures and tables; docs/reference/report.md
-- explains them.

local x = experiment("report_tour", { seed = 11, repeats = 3 })

x:axis("scene", { "cornell_spheres", "veach_lamps" })
x:axis("technique", { "bpt", "nee", "bdpt" })

x:render(function(p)
  return {
    scene = "scenes/" .. p.scene .. "/" .. p.scene .. ".scn",
    integrator = p.technique,
    max_depth = 5,
    resolution = { 160, 120 },
    films = p.technique == "bdpt" and { "strategies", "bounces", "depth" } or { "bounces" },
  }
end)

-- One reference for each scene, by the technique that converges fastest in both.
x:reference {
  from = function()
    return { integrator = "bdpt" }
  end,
  stop = stop.samples(1024),
}

local display = tonemap.srgb { exposure = 0 }
x:measure {
  every = "0.2s",
  rmse = metric.rmse(),
  relmse = metric.relmse { eps = 0.01 },
  ssim = metric.ssim { on = display, range = 1 },
  flip = metric.flip { on = display },
  display = display,
  keep = { exr = "pow2" },
}

x:stop(stop.any { stop.samples(256), stop.time("4s") })

-- Names, colours and the tone map of crops in figures and tables. None of this changes a result.
x:report {
  names = { bpt = "path tracing", nee = "next event", bdpt = "bidirectional" },
  colours = { bdpt = "#117733" },
  display = display,
}

return x
