-- Two diffuse spheres under a uniform sky: small enough for a renderer of seventy lines
-- (scripts/recipes/toy_renderer.py).

local s = scene { resolution = { 48, 32 }, max_depth = 4 }
s:view("front", { position = { 0, 1, 6 }, target = { 0, 0, 0 }, fov = 35 })
s:material("red", { model = "lambert", base_color = { 0.8, 0.3, 0.2 } })
s:material("white", { model = "lambert", base_color = { 0.7, 0.7, 0.7 } })
s:add { name = "left", shape = shape.sphere { radius = 1 }, material = "red", at = { -1, 0, 0 } }
s:add { name = "right", shape = shape.sphere { radius = 0.9 }, material = "white", at = { 0.9, 0, 0.3 } }
s:environment { color = { 1, 1.1, 1.3 } }
return s
