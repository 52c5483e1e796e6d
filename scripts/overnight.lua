-- Overnight: a whole study in one file, to be started in the evening and read in the morning.
--
--     lumbre run scripts/overnight.lua --until 08:00     as far as the night lasts; the same command goes on the next
--     lumbre run scripts/overnight.lua quick=true        the same study in two minutes: small, noisy, and complete
--
-- The protocol is that of the first source, section 5: four families of scenes from easy to hard, three techniques, one
-- picture size, five path edges but for a study of the depth in three of the scenes, a reference of its own for every
-- technique (since techniques need not make quite the same picture), errors measured every half second of render time,
-- and how many frames a second each technique makes. The scenes are relatives of the source's that come with Lumbre.
--
-- In full it takes 42 references of 50 minutes, once, and 42 cells of 5 minutes: about 40 hours, several nights. Whatever
-- is done stays done; references are kept under out/refs for every later experiment.

local x = experiment("overnight", { seed = 2025 })

-- Each scene with the depths of its study. The source's Sponza was seen from two places, in two kinds of light.
local stages = {
  ["cornell-spheres"] = { scene = "scenes/cornell_spheres/cornell_spheres.scn", depths = { 5 } },
  ["veach-lamps"] = { scene = "scenes/veach_lamps/veach_lamps.scn", depths = { 5, 6, 7 } },
  ["bedroom"] = { scene = "scenes/bedroom.lua", depths = { 5 } },
  ["atrium-sky"] = { scene = "scenes/atrium.lua", view = "atrium", light = "skybox", depths = { 5, 6, 7 } },
  ["gallery-sky"] = { scene = "scenes/atrium.lua", view = "gallery", light = "skybox", depths = { 5, 6, 7, 10 } },
  ["atrium-lamps"] = { scene = "scenes/atrium.lua", view = "atrium", light = "lamps", depths = { 5 } },
  ["gallery-lamps"] = { scene = "scenes/atrium.lua", view = "gallery", light = "lamps", depths = { 5 } },
}

-- An axis with one value is a switch: `quick=true` on the command line replaces it.
x:axis("quick", { false })
x:axis("stage", {
  "cornell-spheres", "veach-lamps", "bedroom", "atrium-sky", "gallery-sky", "atrium-lamps", "gallery-lamps",
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

x:render(function(p)
  local stage = stages[p.stage]
  return {
    scene = stage.scene,
    view = stage.view,
    scene_options = stage.light and { light = stage.light } or nil,
    integrator = p.technique,
    max_depth = p.depth,
    resolution = p.quick and { 96, 54 } or { 1280, 720 },
  }
end)

-- The references of one line: each technique against itself with far more time. One reference shared by all would be
-- x:reference { from = function(p) return { integrator = "bdpt" } end, stop = stop.time("50min") }.
--
-- The small pictures of the quick night, told by their paths per sample, end much sooner. A function counts with the text
-- of its whole script: whoever edits this file renders its references again, unless this line is just stop.time("50min").
local function quick_is_done(row) return row.paths == 96 * 54 * row.samples and row.samples >= 64 end
x:reference { stop = stop.any { stop.time("50min"), stop.predicate(quick_is_done) } }

local display = tonemap.srgb()
x:measure {
  every = "0.5s",
  mse = metric.mse(),
  rmse = metric.rmse(),
  ssim = metric.ssim { on = display, range = 1 },
  flip = metric.flip(),
  display = display,
  keep = { exr = "pow2" },
}

x:stop(function(p) return stop.time(p.quick and "0.5s" or "5min") end)

x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "technique", facet = { "stage", "depth" } })
x:figure("depth", { x = "render_s", y = { "ssim" }, by = "depth", facet = { "stage", "technique" } })
x:table("ssim", { value = "ssim", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })
x:table("rmse", { value = "rmse", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })
-- Seconds to the quality that the source calls high.
x:table("time_to_ssim", { value = time_to("ssim", 0.95), rows = { "stage", "depth" }, cols = "technique" })
-- The source's frames per second are samples of every pixel: 1 FPS at 1280x720 is 0.9216 million paths per second.
x:table("speed", { value = "mpaths_s", rows = { "stage", "depth" }, cols = "technique", format = { "md", "csv" } })

return x
