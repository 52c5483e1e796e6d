-- Crytek's atrium of the palace at Sponza [Meinl 2010], which is not part of this project:
-- `folder` is the folder of sponza.obj, its .mtl and its textures, absolute or relative to this
-- file. The OBJ is in centimetres, this scene in metres.
--
-- The banner in the middle of the court names a texture that is not distributed: load the scene with
-- `--lenient`.

local s = scene { resolution = { 1280, 720 }, max_depth = 8 }
local folder = s:option("folder", "")
local light = s:option("light", { "sun", "skybox", "lamps" })

-- The bump maps are colour textures; their height is at most one centimetre.
s:import(folder .. "/sponza.obj", { place = { scale = 0.01 } })

s:camera { position = { -11.2, 1.6, -0.6 }, target = { 0, 4.2, 0.2 }, fov = 58 }
s:view("atrium", { position = { -11.2, 1.6, -0.6 }, target = { 0, 4.2, 0.2 }, fov = 58 })
s:view("gallery", { position = { -11.5, 6.3, 4.4 }, target = { 6, 5.4, 3.6 }, fov = 50 })

if light == "lamps" then
  s:material("bulb", { emission = { 90, 70, 45 } })
  s:environment { color = { 0.004, 0.006, 0.012 } }
  for i = -2, 2 do
    for _, side in ipairs { -1, 1 } do
      s:add {
        name = ("lamp_%d_%+d"):format(i, side),
        shape = shape.sphere { radius = 0.12 },
        material = "bulb",
        at = { 4 * i, 3.2, 2.2 * side },
      }
    end
  end
else
  s:environment { color = light == "skybox" and { 2.4, 2.9, 3.8 } or { 0.9, 1.2, 1.8 } }
  if light == "sun" then
    s:light { name = "sun", direction = { 0.18, -1, 0.16 }, irradiance = { 22, 19, 15 } }
  end
end

return s
