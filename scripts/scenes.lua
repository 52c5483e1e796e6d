-- A picture of every scene of this project, as docs/gallery.md shows them.
--
--     lumbre run scripts/scenes.lua
--
-- Small and quick by default. `lumbre run scripts/scenes.lua width=1280 samples=1024` makes them large and clean.

local x = experiment("scenes", { seed = 3 })

local scenes = {
  { "cornell", "front" }, { "veach_lamps", "room" }, { "veach_mis", "plates" }, { "material_ball", "front" },
  { "atrium", "atrium" }, { "bedroom", "door" }, { "forest", "glade" }, { "many_lights", "row" }, { "instances", "tray" },
  { "model", "front" }, { "hare_box", "front" },
}
local names, views = {}, {}
for i, scene in ipairs(scenes) do names[i], views[scene[1]] = scene[1], scene[2] end

x:axis("scene", names)
x:axis("width", { 320 })
x:axis("samples", { 64 })

local square = { cornell = true, material_ball = true, hare_box = true }

x:render(function(p)
  return {
    scene = "scenes/" .. p.scene .. ".lua",
    view = views[p.scene],
    scene_options = p.scene == "model" and { floor = true } or nil,
    -- Two lamps that hide their light are found from the lamps' side.
    integrator = p.scene == "veach_lamps" and "bdpt" or "nee",
    max_depth = 8,
    resolution = { p.width, square[p.scene] and p.width or p.width * 9 // 16 },
    sampler = "sobol",
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
