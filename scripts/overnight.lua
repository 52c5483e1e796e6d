-- scripts/overnight.lua: the whole study of thesis S0, section 5, in one experiment.
--
--     lumbre run scripts/overnight.lua --until 08:00   about eight hours; repeat it to resume
--     lumbre run scripts/overnight.lua quick=true      all stages, small and noisy: two minutes on
--                                                      two cores
--     lumbre run scripts/overnight.lua full=true       as in the thesis: several nights
--     lumbre run scripts/overnight.lua folder=/path/to/vkraytracing
--                                                      the scenes of the thesis, where published
--     lumbre report out/latest                         figures, tables and page, at any time
--
-- scripts/theses/ has a smaller script for each figure and table, with its claims; this one makes
-- one night and one report of them. The protocol is that of thesis S0 (docs/bibliography.md), by
-- section:
--
--   5.1.2  1280x720, five path edges, the Disney model; every technique renders its own reference
--          in 50 minutes, since the pictures of two techniques may differ slightly. Without
--          `full=true`: 640x360, and `bdpt` renders one reference for all techniques in 16 minutes
--   5.1.3  every half second of render time the picture is kept and MSE, RMSE, SSIM and FLIP are
--          computed on linear radiance; the gamma of 1/2.2 applies to displayed pictures only
--   5.2    four families of scenes from easy to hard: a box with mirror and glass, lamps that hide
--          their light, a bedroom with wide windows, a court from two positions in two kinds of
--          light. Scenes of this project replace those of the thesis unless `folder` is given
--   5.3.1  depths 5, 6 and 7 in the room of the lamps and in the court, 10 in the gallery and in
--          the room of the lamps
--   5.3.2  convergence of the three techniques, and the time to an SSIM of 0.95
--   5.3.6  the box with analytic spheres and with spheres of triangles
--   5.3.7  frames per second in the order of tables 5.2 and 5.3; `lumbre report` compares machines
--   5.4    scripts/theses/s0_table_5_4.lua
--
-- Additions: three repeats, so that means have confidence intervals, and the stage `veach-films`,
-- whose runs also keep layers by depth, strategy and number of bounces. These layers take time, so
-- its rates are not comparable with those of other stages. Techniques sample one light at each
-- vertex; `lights = "all"` in the render table samples all of them, as the thesis does.
--
-- By default: 16 references of 16 minutes and 153 runs of a minute, about eight hours with the
-- measurements, and 3 GB of pictures. With `full=true`: 48 references of 50 minutes and 153 runs of 5
-- minutes, about 53 hours. The thesis keeps a picture at every measurement, too: `png = "every"` in
-- `keep` below does, and takes 120 GB. Each stage begins with its references, so that the first curves
-- stand after half an hour. Finished runs are kept. References are in out/refs for every later
-- experiment.
--
-- Results in out/latest:
--     figures/convergence_*   SSIM and RMSE against render time by technique, per stage and depth
--     figures/depth_*         SSIM against render time by depth, per stage and technique
--     tables/{ssim,rmse}      final values by stage, depth and technique
--     tables/time_to_ssim     seconds of render time to an SSIM of 0.95
--     tables/fps              frames per second; a frame is one sample of every pixel

local s0 = require("theses.lib.s0")
local x = experiment("overnight", { seed = 2025, repeats = 3 })

-- Depths of the stages that have several.
local depths = {
  ["veach-lamps"] = { [5] = true, [6] = true, [7] = true, [10] = true },
  ["atrium-sky"] = { [5] = true, [6] = true, [7] = true },
  ["gallery-sky"] = { [5] = true, [6] = true, [7] = true, [10] = true },
}

-- An axis with one value can be replaced on the command line: `quick=true`.
x:axis("quick", { false })
x:axis("full", { false })
x:axis("folder", { "own" })
-- In the order of thesis S0, table 5.2.
x:axis("stage", {
  "cornell-balls", "cornell-spheres", "bedroom", "veach-lamps", "atrium-sky", "gallery-sky", "atrium-lamps",
  "gallery-lamps", "veach-films",
})
x:axis("depth", { 5, 6, 7, 10 })
x:axis("technique", { "bpt", "nee", "bdpt" })

x:skip("not one of this scene's depths", function(p)
  return not (depths[p.stage] or { [5] = true })[p.depth]
end)
x:skip("left out of the quick night", function(p) return p.quick and (p.depth == 6 or p.depth == 10) end)

-- Returns the layers that a run keeps. Light by strategy and depth is kept for `bdpt` only.
local function films(p)
  if p.stage ~= "veach-films" then return nil end
  return p.technique == "bdpt" and { "depth", "strategies", "bounces" } or { "bounces" }
end

x:render(function(p)
  local render = s0.scene(p.stage == "veach-films" and "veach-lamps" or p.stage, p.folder)
  render.integrator = p.technique
  render.max_depth = p.depth
  render.resolution = p.quick and { 80, 45 } or p.full and { 1280, 720 } or { 640, 360 }
  render.films = films(p)
  return render
end)

-- With `full=true`, as in the quick night, each technique is measured against its own reference.
x:reference {
  from = function(p) return (p.quick or p.full) and {} or { integrator = "bdpt" } end,
  stop = function(p) return stop.time(p.quick and "1.5s" or p.full and "50min" or "16min") end,
}

x:measure {
  every = "0.5s",
  mse = metric.mse(),
  rmse = metric.rmse(),
  ssim = metric.ssim { range = 1 },
  flip = metric.flip(),
  display = tonemap.gamma { gamma = 2.2 },
  keep = { exr = "pow2" },
}

x:stop(function(p) return stop.time(p.quick and "0.4s" or p.full and "5min" or "1min") end)

x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "technique", facet = { "stage", "depth" } })
x:figure("depth", { x = "render_s", y = { "ssim" }, by = "depth", facet = { "stage", "technique" } })
x:table("ssim", { value = "ssim", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })
x:table("rmse", { value = "rmse", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })
-- Seconds of render time to an SSIM of 0.95, which thesis S0 calls high quality.
x:table("time_to_ssim", { value = time_to("ssim", 0.95), rows = { "stage", "depth" }, cols = "technique" })
-- A frame is one sample of every pixel: 1 FPS at 1280x720 is 0.9216 million paths per second.
x:table("fps", { value = "fps", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })

return x
