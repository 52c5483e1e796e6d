-- Crytek's atrium of the palace at Sponza [Meinl 2010], which is not part of this project: `folder` names where sponza.obj,
-- its .mtl and its textures are, as seen from this file or in full. The file is in centimetres, this scene in metres.
--
-- The banner in the middle of the court names a picture that was never given away: load it with `--lenient`.

local s = scene { resolution = { 1280, 720 }, max_depth = 8 }
local folder = s:option("folder", "")
local light = s:option("light", { "sun", "skybox", "lamps" })

-- Bumps of these are pictures of colours, as high as a centimetre at most.
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
