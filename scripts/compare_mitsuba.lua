-- scripts/compare_mitsuba.lua: one picture by the three techniques of Lumbre and by Mitsuba 3.
--
--     lumbre run scripts/compare_mitsuba.lua                          full size: about five hours
--     lumbre run scripts/compare_mitsuba.lua quick=true               noisy: less than a minute
--     lumbre run scripts/compare_mitsuba.lua python=venv/bin/python   another Python interpreter
--     lumbre run scripts/compare_mitsuba.lua scene=room.xml           another scene, of any format
--     lumbre report out/latest                                        table 5.4 and figure 5.20
--
-- Repeats thesis S0, section 5.4, table 5.4 and figure 5.20 (docs/bibliography.md), where each
-- technique also has 50 minutes. The reference is rendered by Mitsuba in twice the time. The scene
-- is exported, with its Disney materials as `principled`, and rendered by Mitsuba's `path`, which
-- combines light sampling and BSDF sampling, as in the thesis; paths have at most ten edges.
-- Mitsuba with another seed is a fourth technique: its error against the reference is noise
-- alone, and smaller differences cannot be resolved. Mitsuba's render time is the time that it
-- reports for its renderer.
--
-- Needs a Python interpreter with Mitsuba: pip install mitsuba. Without it every cell is skipped,
-- and the plan gives the reason.
--
-- Results in out/latest:
--     tables/{mse,rmse,ssim,flip}   final error by technique
--     figures/convergence*          SSIM and RMSE against render time by technique

local x = experiment("compare_mitsuba", { seed = 54 })

-- Axes with one value can be replaced on the command line: `quick=true`.
x:axis("quick", { false })
x:axis("python", { "python3" })
x:axis("scene", { "scenes/veach_lamps.lua" })
x:axis("technique", { "bpt", "nee", "bdpt", "external:mitsuba" })

local function mitsuba(p) return { integrator = "external:mitsuba", python = p.python } end

x:render(function(p)
  local own = p.technique == "external:mitsuba" and mitsuba(p) or { integrator = p.technique }
  own.scene = p.scene
  own.max_depth = 10
  own.resolution = p.quick and { 160, 90 } or { 1280, 720 }
  return own
end)

x:reference { from = mitsuba, stop = function(p) return stop.time(p.quick and "10s" or "100min") end }

x:measure {
  every = "0.5s",
  mse = metric.mse(),
  rmse = metric.rmse(),
  ssim = metric.ssim { range = 1 },
  flip = metric.flip(),
  display = tonemap.gamma { gamma = 2.2 },
  keep = { exr = "pow2" },
}

x:stop(function(p) return stop.time(p.quick and "4s" or "50min") end)

for _, metric_column in ipairs { "mse", "rmse", "ssim", "flip" } do
  x:table(metric_column, { value = metric_column, rows = "technique" })
end
x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "technique" })

return x
