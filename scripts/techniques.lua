-- scripts/techniques.lua: all techniques over eight scenes, at equal time and interleaved.
--
--     lumbre run scripts/techniques.lua                       16 repeats of 30 s: about 9 hours and references
--     lumbre run scripts/techniques.lua quick=true seconds=3  small pictures: about an hour
--     lumbre report out/latest                                verdicts, figures, tables and page
--
-- Every technique renders every scene for the same render time, in turns of at most half a second,
-- so that a machine that slows down slows down all of them. Training of `guided_bdpt` and the photons of
-- `sppm` and `vcm` are on the clock. `sppm` and `vcm` are consistent and biased; references are
-- rendered by the unbiased technique that is least noisy in the scene, and shared by all.
--
--   diffuse   a box of matt walls and spheres, which every technique renders well
--   caustics  light through glass and from a mirror, seen directly and in the mirror
--   door      a room that is lit through a door ajar
--   lights    a thousand coloured lamps, chosen by power, or by a light tree (`nee-tree`)
--   sky       a court under sun and sky, from an environment map
--   glossy    plates of increasing roughness under lights of increasing size
--   leaves    leaves cut out by alpha masks
--   lamps     lamps that hide their light

local x = experiment("techniques", { seed = 32, repeats = 16 })

-- Scene, view and options, and the technique of its reference.
local stages = {
  diffuse = { scene = "scenes/cornell.lua", options = { inside = "blocks" }, reference = "nee" },
  caustics = { scene = "scenes/cornell.lua", options = { inside = "spheres" }, reference = "bdpt" },
  door = { scene = "scenes/door_ajar.lua", view = "room", reference = "guided" },
  lights = { scene = "scenes/many_lights.lua", view = "row", reference = "nee", tree = true },
  sky = { scene = "scenes/atrium.lua", view = "atrium", options = { light = "skybox" }, reference = "nee" },
  glossy = { scene = "scenes/veach_mis.lua", view = "plates", reference = "nee" },
  leaves = { scene = "scenes/masked_leaves/masked_leaves.scn", reference = "nee" },
  lamps = { scene = "scenes/veach_lamps.lua", view = "room", reference = "bdpt" },
}

-- Axes with one value can be replaced on the command line: `seconds=60`. A reference has forty times the render time of
-- a picture.
x:axis("quick", { false })
x:axis("seconds", { 30 })
x:axis("stage", { "diffuse", "caustics", "door", "lights", "sky", "glossy", "leaves", "lamps" })
x:axis("technique", { "bpt", "nee", "nee-tree", "guided", "bdpt", "guided_bdpt", "lvc", "sppm", "vcm" })

x:skip("a light tree is for many lights", function(p)
  return p.technique == "nee-tree" and not stages[p.stage].tree
end)

local function picture(p, technique)
  local stage = stages[p.stage]
  return {
    scene = stage.scene,
    view = stage.view,
    scene_options = stage.options,
    integrator = technique == "nee-tree" and "nee" or technique,
    select = technique == "nee-tree" and "tree" or nil,
    max_depth = 8,
    resolution = p.quick and { 96, 54 } or { 640, 360 },
  }
end

x:render(function(p) return picture(p, p.technique) end)

x:reference {
  from = function(p) return picture(p, stages[p.stage].reference) end,
  stop = function(p) return stop.time(40 * p.seconds) end,
}

x:measure {
  every = "1s",
  rmse = metric.rmse(),
  relmse = metric.relmse_trimmed(),
  smape = metric.smape(),
  flip = metric.flip { on = tonemap.srgb() },
  display = tonemap.srgb(),
  keep = { exr = "pow2" },
}

x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = { "rmse", "smape" }, by = "technique", facet = "stage" })
x:table("rmse", { value = "rmse", rows = "stage", cols = "technique", format = { "md", "csv" } })
x:table("relmse", { value = "relmse", rows = "stage", cols = "technique", format = { "md", "csv" } })
x:table("smape", { value = "smape", rows = "stage", cols = "technique", format = { "md", "csv" } })
-- Camera paths a second: what a technique's samples cost.
x:table("fps", { value = "fps", rows = "stage", cols = "technique", format = { "md", "csv" } })

return x
