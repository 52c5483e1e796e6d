-- Overnight: a whole study in one file, to be started in the evening and read in the morning.
--
--     lumbre run scripts/overnight.lua --until 08:00     as far as the night lasts; the same command goes on the next
--     lumbre run scripts/overnight.lua quick=true        the same study in two minutes: small, noisy, and complete
--     lumbre report out/latest                           its figures, tables and page, at any time
--
-- The protocol is that of thesis S0 (docs/bibliography.md), section 5, line by line:
--
--   5.1.2  1280x720, five path edges, the Disney model; every reference by its own technique in 50 minutes, since
--          techniques need not make quite the same picture
--   5.1.3  every half second of render time the picture is captured and MSE, RMSE, SSIM and FLIP are computed, on linear
--          radiance; the gamma of 1/2.2 is on the pictures that are shown and in no metric
--   5.2    four families of scenes from easy to hard: a box of mirror and glass, lamps that hide their light, a bedroom
--          with wide windows, a court seen from two places in two kinds of light. They are relatives of the source's
--   5.3.1  the depth: 5, 6 and 7 under the lamps and in the court, 10 in the gallery and under the lamps
--   5.3.2  convergence of the three techniques, and the time to an SSIM of 0.95
--   5.3.6  the box with true spheres and with spheres of triangles
--   5.3.7  frames a second, in the order of tables 5.2 and 5.3; `lumbre report` puts two machines side by side
--   5.4    scripts/compare_mitsuba.lua
--
-- What it does beyond: three repeats, so that means have intervals, and one stage more, `veach-films`, whose runs also
-- keep light by depth, by strategy and by bounces. That takes time, so its rates stand apart. Techniques ask one light
-- at a vertex; `lights = "all"` in the render table asks all of them, as the source does.
--
-- In full it takes 48 references of 50 minutes, once, and 153 runs of 5 minutes: about 53 hours, several nights, and about
-- 120 GB for the captures, unless the word `png` is left out below. Whatever is done stays done; references are kept under
-- out/refs for every later experiment.

local x = experiment("overnight", { seed = 2025, repeats = 3 })

-- Each scene with the depths of its study, in the order of table 5.2.
local stages = {
  ["cornell-balls"] = { scene = "scenes/cornell.lua", options = { inside = "balls" }, depths = { 5 } },
  ["cornell-spheres"] = { scene = "scenes/cornell.lua", options = { inside = "spheres" }, depths = { 5 } },
  ["bedroom"] = { scene = "scenes/bedroom.lua", depths = { 5 } },
  ["veach-lamps"] = { scene = "scenes/veach_lamps.lua", depths = { 5, 6, 7, 10 } },
  ["atrium-sky"] = { scene = "scenes/atrium.lua", view = "atrium", options = { light = "skybox" }, depths = { 5, 6, 7 } },
  ["gallery-sky"] = { scene = "scenes/atrium.lua", view = "gallery", options = { light = "skybox" }, depths = { 5, 6, 7, 10 } },
  ["atrium-lamps"] = { scene = "scenes/atrium.lua", view = "atrium", options = { light = "lamps" }, depths = { 5 } },
  ["gallery-lamps"] = { scene = "scenes/atrium.lua", view = "gallery", options = { light = "lamps" }, depths = { 5 } },
  ["veach-films"] = { scene = "scenes/veach_lamps.lua", depths = { 5 }, films = true },
}

-- An axis with one value is a switch: `quick=true` on the command line replaces it.
x:axis("quick", { false })
x:axis("stage", {
  "cornell-balls", "cornell-spheres", "bedroom", "veach-lamps", "atrium-sky", "gallery-sky", "atrium-lamps",
  "gallery-lamps", "veach-films",
})
x:axis("depth", { 5, 6, 7, 10 })
x:axis("technique", { "bpt", "nee", "bdpt" })

x:skip("not one of this scene's depths", function(p)
  for _, depth in ipairs(stages[p.stage].depths) do
    if depth == p.depth then return false end
  end
  return true
end)
x:skip("left out of the quick night", function(p) return p.quick and (p.depth == 6 or p.depth == 10) end)

-- What a run keeps beside its picture: strategies and depths are those of bidirectional paths.
local function films(p)
  if not stages[p.stage].films then return nil end
  return p.technique == "bdpt" and { "depth", "strategies", "bounces" } or { "bounces" }
end

x:render(function(p)
  local stage = stages[p.stage]
  return {
    scene = stage.scene,
    view = stage.view,
    scene_options = stage.options,
    integrator = p.technique,
    max_depth = p.depth,
    resolution = p.quick and { 80, 45 } or { 1280, 720 },
    films = films(p),
    -- Runs with films go one by one, which is to keep no other stage from going in lanes.
    accel = { lanes = films(p) and "never" or "auto" },
  }
end)

-- The references of one line: each technique against itself with far more time. One reference shared by all would be
-- x:reference { from = function(p) return { integrator = "bdpt" } end, stop = stop.time("50min") }.
x:reference { stop = function(p) return stop.time(p.quick and "1.5s" or "50min") end }

x:measure {
  every = "0.5s",
  mse = metric.mse(),
  rmse = metric.rmse(),
  ssim = metric.ssim { range = 1 },
  flip = metric.flip(),
  display = tonemap.gamma { gamma = 2.2 },
  keep = { exr = "pow2", png = "every" },
}

x:stop(function(p) return stop.time(p.quick and "0.4s" or "5min") end)

x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "technique", facet = { "stage", "depth" } })
x:figure("depth", { x = "render_s", y = { "ssim" }, by = "depth", facet = { "stage", "technique" } })
x:table("ssim", { value = "ssim", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })
x:table("rmse", { value = "rmse", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })
-- Seconds to the quality that the source calls high.
x:table("time_to_ssim", { value = time_to("ssim", 0.95), rows = { "stage", "depth" }, cols = "technique" })
-- A frame is one sample of every pixel: 1 FPS at 1280x720 is 0.9216 million paths per second.
x:table("fps", { value = "fps", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })

return x
