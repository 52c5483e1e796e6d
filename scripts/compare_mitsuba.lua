-- The same picture by Lumbre's three techniques and by Mitsuba 3: section 5.4 of thesis S0 (docs/bibliography.md) in one script.
--
--     lumbre run scripts/compare_mitsuba.lua                              as the source did: 50 minutes each, five hours
--     lumbre run scripts/compare_mitsuba.lua quick=true                   small and noisy, less than a minute
--     lumbre run scripts/compare_mitsuba.lua python=venv/bin/python       another interpreter than python3 on PATH
--     lumbre report out/latest                                            table 5.4 and figure 5.20
--
-- Mitsuba's picture is the reference, of twice the time: the scene is exported, with its Disney materials as `principled`,
-- and rendered by `path`, which joins shadow rays and BSDF sampling, as the source has it; ten path edges. Beside the
-- three techniques stands Mitsuba itself with another seed: what it measures against itself is noise, and nothing below
-- that can be told.
-- Its clock is what it says to have spent inside its renderer.
--
-- It takes an interpreter with the package: pip install mitsuba. Without it every cell is left out, with the reason.

local x = experiment("compare_mitsuba", { seed = 54 })

-- Axes with one value are switches of the command line.
x:axis("quick", { false })
x:axis("python", { "python3" })
x:axis("technique", { "bpt", "nee", "bdpt", "external:mitsuba" })

local function mitsuba(p) return { integrator = "external:mitsuba", python = p.python } end

x:render(function(p)
  local own = p.technique == "external:mitsuba" and mitsuba(p) or { integrator = p.technique }
  own.scene = "scenes/veach_lamps.lua"
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
