-- scripts/scenes.lua: a picture of every built-in scene, as docs/gallery.md shows them.
--
--     lumbre run scripts/scenes.lua                                a preview of each scene in a few minutes
--     lumbre run scripts/scenes.lua width=960 share=1              the pictures of the gallery
--     lumbre run scripts/scenes.lua width=960 share=1 --only scene=forest
--
-- `width` is the width in pixels. `share` is the fraction of the samples with which a scene's noise
-- is not visible at 960 pixels.
--
-- Results in out/latest:
--     runs/**/final.png    the picture of a scene

local x = experiment("scenes", { seed = 3 })

-- View, samples per pixel at share = 1, and where they differ from the defaults: the integrator and
-- the height for a width.
local function wide(width) return width * 9 // 16 end
local function upright(width) return width * 3 // 4 end
local scenes = {
  cornell = { view = "front", samples = 512, height = upright },
  -- Bidirectional: two lamps with shades light this room from behind.
  veach_lamps = { view = "room", samples = 96, integrator = "bdpt" },
  veach_mis = { view = "plates", samples = 512 },
  material_ball = { view = "front", samples = 512, height = upright },
  atrium = { view = "atrium", samples = 512 },
  bedroom = { view = "door", samples = 512 },
  -- Bidirectional: light enters through a gap.
  door_ajar = { view = "room", samples = 2560, integrator = "bdpt", options = { opening = 30 } },
  forest = { view = "glade", samples = 96 },
  -- Bidirectional: a small lamp behind glass and metal.
  still_life = { view = "front", samples = 64, integrator = "bdpt", height = upright },
  many_lights = { view = "row", samples = 512 },
  instances = { view = "tray", samples = 256 },
  model = { view = "front", samples = 256, options = { floor = true } },
  hare_box = { view = "front", samples = 512, height = upright },
}
local names = {}
for name in pairs(scenes) do names[#names + 1] = name end
table.sort(names)

x:axis("scene", names)
x:axis("width", { 320 })
x:axis("share", { 0.125 })

x:render(function(p)
  local scene = scenes[p.scene]
  return {
    scene = "scenes/" .. p.scene .. ".lua",
    view = scene.view,
    scene_options = scene.options,
    integrator = scene.integrator or "nee",
    max_depth = 8,
    resolution = { p.width, (scene.height or wide)(p.width) },
    sampler = "sobol",
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(math.max(1, math.floor(scenes[p.scene].samples * p.share))) end)

return x
