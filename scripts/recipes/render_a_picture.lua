-- scripts/recipes/render_a_picture.lua: one picture of one scene.

local x = experiment("render_a_picture", { seed = 1 })

-- Axes with one value are switches of the command line: size=512 samples=1024.
x:axis("size", { 192 })
x:axis("samples", { 64 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    scene_options = { inside = "spheres" },
    view = "front",
    integrator = "bdpt",
    max_depth = 8,
    resolution = { p.size, p.size },
  }
end)

x:measure { display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
