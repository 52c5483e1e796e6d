-- scripts/scenes.lua: a picture of every scene in scenes/*.lua, as shown in docs/gallery.md.
--
--     lumbre run scripts/scenes.lua                          small and quick
--     lumbre run scripts/scenes.lua width=1280 samples=1024  large and clean
--
-- Results in out/latest, without tables and figures:
--     runs/**/final.png   a picture for each scene

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
    -- The lamps hide their light: paths must start at them.
    integrator = p.scene == "veach_lamps" and "bdpt" or "nee",
    max_depth = 8,
    resolution = { p.width, square[p.scene] and p.width or p.width * 9 // 16 },
    sampler = "sobol",
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
