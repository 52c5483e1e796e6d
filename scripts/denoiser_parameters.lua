-- scripts/denoiser_parameters.lua: how good the built-in denoiser is, by scene, samples and its parameters.
--
--     lumbre run scripts/denoiser_parameters.lua                               the defaults beside no denoiser
--     lumbre run scripts/denoiser_parameters.lua sigma_luminance=1,1.5,2       one parameter
--     lumbre run scripts/denoiser_parameters.lua reference=64 width=64         the same in a minute
--
-- Every parameter is an axis with one value, which the command line replaces. Nights share pictures and references, so
-- a further value renders only what is new.
--
-- Results in out/latest:
--     tables/rmse.md, tables/flip.md    errors by scene and samples; the report has them by all axes

local x = experiment("denoiser_parameters", { seed = 30 })

local stages = {
  cornell = { scene = "scenes/cornell.lua" },
  glass = { scene = "scenes/cornell.lua", options = { inside = "spheres" } },
  plates = { scene = "scenes/veach_mis.lua", view = "plates" },
  hare = { scene = "scenes/hare_box.lua", view = "front" },
  atrium = { scene = "scenes/atrium.lua", view = "atrium" },
  bedroom = { scene = "scenes/bedroom.lua", view = "door" },
  ball = { scene = "scenes/material_ball.lua", view = "front" },
  forest = { scene = "scenes/forest.lua", view = "glade" },
}

x:axis("stage", { "cornell", "glass", "plates", "hare", "atrium", "bedroom", "ball", "forest" })
x:axis("samples", { 4, 16, 64 })
x:axis("width", { 192 })
x:axis("reference", { 1024 })
x:axis("denoise", { "none", "atrous" })
x:axis("levels", { 4 })
x:axis("sigma_luminance", { 1.5 })
x:axis("sigma_albedo", { 0.2 })
x:axis("normal_power", { 64 })

x:render(function(p)
  local stage = stages[p.stage]
  return {
    scene = stage.scene,
    view = stage.view,
    scene_options = stage.options,
    integrator = "nee",
    max_depth = 8,
    resolution = { p.width, p.width * 3 // 4 },
    denoise = p.denoise,
    atrous = p.denoise == "atrous" and {
      levels = p.levels,
      sigma_luminance = p.sigma_luminance,
      sigma_albedo = p.sigma_albedo,
      normal_power = p.normal_power,
    } or nil,
  }
end)

x:reference {
  from = function() return { sampler = "sobol" } end,
  stop = function(p) return stop.samples(p.reference) end,
}

x:measure {
  every = "1h",
  rmse = metric.rmse(),
  smape = metric.smape(),
  flip = metric.flip { on = tonemap.srgb() },
  display = tonemap.srgb { exposure = -1 },
}

x:stop(function(p) return stop.samples(p.samples) end)

x:table("rmse", { value = "rmse", rows = { "stage", "samples" }, cols = "denoise" })
x:table("flip", { value = "flip", rows = { "stage", "samples" }, cols = "denoise" })

return x
