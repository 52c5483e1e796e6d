-- scripts/theses/lib/s0.lua: scenes, techniques and measurements of thesis S0, chapter 5, for the
-- scripts in scripts/theses/ and scripts/overnight.lua (docs/bibliography.md).

local s0 = {}

-- Techniques of references. A reference inherits what it does not state.
local bpt, bdpt = { integrator = "bpt" }, { integrator = "bdpt" }
local nee = { integrator = "nee", mis = "power", select = "power", lights = "one" }

-- The eight rows of table 5.2. `own` replaces the scene of the document. `file` is the document's
-- own, below the folder that the axis `folder` gives; its bedroom and atrium are not published.
-- `reference` is the technique of the stage's reference. `lights` is what comes nearest to one
-- shadow ray for each lamp: `all` connects to every triangle of a lamp.
s0.stages = {
  ["cornell-balls"] = {
    own = { scene = "scenes/cornell.lua", scene_options = { inside = "balls" } },
    file = "cornellbox_sphere_mesh.scn", reference = bdpt, lights = "one",
  },
  ["cornell-spheres"] = {
    own = { scene = "scenes/cornell.lua", scene_options = { inside = "spheres" } },
    file = "cornellbox_sphere.scn", reference = bdpt, lights = "one",
  },
  ["bedroom"] = { own = { scene = "scenes/bedroom.lua" }, reference = nee, lights = "one" },
  ["veach-lamps"] = {
    own = { scene = "scenes/veach_lamps.lua" },
    file = "Bidirectional/veach_lamps.scn", reference = bdpt, lights = "one",
  },
  ["atrium-sky"] = {
    own = { scene = "scenes/atrium.lua", view = "atrium", scene_options = { light = "skybox" } },
    reference = bpt, lights = "one",
  },
  ["gallery-sky"] = {
    own = { scene = "scenes/atrium.lua", view = "gallery", scene_options = { light = "skybox" } },
    reference = bpt, lights = "one",
  },
  ["atrium-lamps"] = {
    own = { scene = "scenes/atrium.lua", view = "atrium", scene_options = { light = "lamps" } },
    reference = bdpt, lights = "all",
  },
  ["gallery-lamps"] = {
    own = { scene = "scenes/atrium.lua", view = "gallery", scene_options = { light = "lamps" } },
    reference = bdpt, lights = "all",
  },
}

-- The document displays pictures with a gamma of 2.2.
s0.display = tonemap.gamma { gamma = 2.2 }

-- Returns the value of a pair for the full or the quick form of a script.
function s0.form(p, values) return p.quick and values[2] or values[1] end

-- Returns the scene of a stage as keys of a render table: the document's own below `folder`, or that
-- of this project if `folder` is "own" or the document's is not published.
function s0.scene(name, folder)
  local stage, keys = s0.stages[name], {}
  if folder ~= "own" and stage.file then
    keys.scene = folder .. "/" .. stage.file
    -- As published, the box with spheres has a tenth of the light of the one with meshes.
    if name:find("cornell") then keys.set = { ["materials.light.emission"] = { 10, 10, 10 } } end
    return keys
  end
  for key, value in pairs(stage.own) do keys[key] = value end
  return keys
end

-- Returns the render table of a technique at the stage of a point: five path edges unless `depth`
-- is given, and the Gaussian of section 4.4.2 with the radius of the published program.
-- `nee-document` is the estimator of Algorithm 4: points uniform over the area of the lamps, and light
-- that paths hit is added to that of connections, so that most light counts twice.
function s0.picture(p, technique, resolution, depth)
  local render = s0.scene(p.stage, p.folder)
  render.max_depth = depth or 5
  render.resolution = resolution
  render.aa = { filter = "antialiasing_radius", radius = 0.15 }
  render.integrator = technique
  if technique == "nee-document" then
    render.integrator, render.select = "nee_sum", "area"
    render.lights = s0.stages[p.stage].lights
  end
  return render
end

-- Returns an experiment that renders `stages` by all techniques for the same time and measures them
-- against one reference for each stage, and `nee-document` against one of its own, since it converges
-- to another picture: "every technique has its own reference" (section 5.1.3). `size` and `seconds` are pairs: full and quick form.
function s0.convergence(name, options)
  local x = experiment(name, { seed = 2026, repeats = 5 })
  x:axis("quick", { false })
  x:axis("folder", { "own" })
  x:axis("stage", options.stages)
  x:axis("technique", { "bpt", "nee", "nee-document", "bdpt" })
  local form = s0.form
  x:render(function(p) return s0.picture(p, p.technique, form(p, options.size)) end)
  x:reference {
    from = function(p)
      if p.technique == "nee-document" then return { integrator = "nee_sum" } end
      return s0.stages[p.stage].reference
    end,
    stop = function(p) return stop.time(10 * form(p, options.seconds)) end,
  }
  -- `ssim` compares pictures as displayed: s0_section_5_1_3.lua shows why.
  x:measure {
    every = "0.1s",
    rmse = metric.rmse(),
    ssim = metric.ssim { on = s0.display },
    fireflies = metric.fireflies(),
    display = s0.display,
    keep = { exr = "pow2" },
  }
  x:stop(function(p) return stop.time(form(p, options.seconds)) end)
  x:figure("convergence", { x = "render_s", y = { "ssim", "rmse" }, by = "technique", facet = "stage" })
  x:table("rmse", { value = "rmse", rows = "stage", cols = "technique" })
  x:table("ssim", { value = "ssim", rows = "stage", cols = "technique" })
  x:table("time_to_ssim", { value = time_to("ssim", 0.95), rows = "stage", cols = "technique" })
  x:table("samples", { value = "samples", rows = "stage", cols = "technique" })
  return x
end

return s0
