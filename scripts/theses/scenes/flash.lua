-- A small plate under a small lamp: light that returns from it shows the delay of its material.
--
-- Option `composed`: whether the plate is three tenths of an exponential profile and seven tenths
-- of an Epanechnikov profile, as in figure 3.3 of thesis S2 (docs/bibliography.md).

local s = scene { resolution = { 16, 16 }, max_depth = 2 }
local composed = s:option("composed", false)

s:view("plate", { position = { 0, 1, 0.5 }, target = { 0, 0, 0 }, fov = 2 })
s:material("lamp", { emission = { 1000, 1000, 1000 }, emitter_reflects = false })
local grey = { model = "lambert", base_color = { 0.8, 0.8, 0.8 } }
if composed then
  grey.delay, grey.delay_rate = "exponential", 2
  s:material("early", grey)
  grey.delay, grey.delay_mean, grey.delay_width = "epanechnikov", 2, 0.5
  s:material("late", grey)
  s:material("plate", { parts = { "early", "late" }, weights = { 0.3, 0.7 } })
else
  s:material("plate", grey)
end
s:add { name = "plate", shape = shape.grid { size = { 0.2, 0.2 } }, material = "plate" }
s:add {
  name = "lamp", shape = shape.grid { size = { 0.02, 0.02 } }, material = "lamp",
  at = { 0, 1, -0.5 }, rotate = { 180, 0, 0 },
}
return s
