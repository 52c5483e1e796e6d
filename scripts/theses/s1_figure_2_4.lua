-- scripts/theses/s1_figure_2_4.lua: number of bounces of each pixel.
--
--     lumbre run scripts/theses/s1_figure_2_4.lua              20 seconds
--     lumbre run scripts/theses/s1_figure_2_4.lua quick=true   3 seconds
--
-- Thesis S1 (docs/bibliography.md), section 2.2.2: figure 2.4, a map of the bounces that each pixel
-- of an open scene needs, none where only the sky is seen, many in corners. Here: the layers
-- `bounces` (bounces of the light that arrives) and `rays` (rays per sample) of a court that is
-- open to the sky, in runs/**/films/.

local x = experiment("s1_figure_2_4", { seed = 2026 })

x:axis("quick", { false })

x:render(function(p)
  return {
    scene = "scenes/atrium.lua",
    view = "balcony",
    scene_options = { light = "skybox" },
    integrator = "bpt",
    max_depth = 8,
    resolution = p.quick and { 96, 54 } or { 320, 180 },
    films = { "bounces", "rays" },
  }
end)
x:stop(function(p) return stop.samples(p.quick and 32 or 512) end)
return x
