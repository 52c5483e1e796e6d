-- scripts/theses/s0_table_5_4.lua: the three techniques beside Mitsuba 3.
--
--     lumbre run scripts/theses/s0_table_5_4.lua                          30 minutes
--     lumbre run scripts/theses/s0_table_5_4.lua quick=true               70 seconds
--     lumbre run scripts/theses/s0_table_5_4.lua python=venv/bin/python   another Python interpreter
--     lumbre run scripts/theses/s0_table_5_4.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 5.4: table 5.4 (MSE, RMSE, SSIM and FLIP against a
-- picture by Mitsuba) and figure 5.20 (pictures and FLIP maps, which `lumbre report` draws). The
-- document: the room of the lamps, 1280x720, ten path edges, 50 minutes for each technique and for
-- Mitsuba's `path`. Here: fewer pixels; Mitsuba with another seed shows how much of each error is
-- noise. Needs `pip install mitsuba`: without it every cell is skipped.

local s0 = require("lib.s0")
local x = experiment("s0_table_5_4", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("python", { "python3" })
x:axis("stage", { "veach-lamps" })
x:axis("technique", { "bpt", "nee", "bdpt", "external:mitsuba" })

x:render(function(p)
  local render = s0.picture(p, p.technique, s0.form(p, { { 320, 180 }, { 64, 36 } }), 10)
  render.aa = nil -- Mitsuba has other filters.
  render.python = p.technique == "external:mitsuba" and p.python or nil
  return render
end)
x:reference {
  from = function(p) return { integrator = "external:mitsuba", python = p.python } end,
  stop = function(p) return stop.time(s0.form(p, { "10min", "30s" })) end,
}
x:measure {
  every = "0.5s",
  mse = metric.mse(),
  rmse = metric.rmse(),
  ssim = metric.ssim { on = s0.display },
  flip = metric.flip { on = s0.display },
  display = s0.display,
  keep = { exr = "pow2" },
}
x:stop(function(p) return stop.time(s0.form(p, { 60, 2 })) end)
for _, column in ipairs { "mse", "rmse", "ssim", "flip" } do
  x:table(column, { value = column, rows = "technique" })
end
x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "technique" })
return x
