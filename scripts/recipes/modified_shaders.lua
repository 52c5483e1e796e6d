-- scripts/recipes/modified_shaders.lua: a technique by the shaders of the program, and by those of a folder.

local x = experiment("modified_shaders", { seed = 35, repeats = 3 })

-- Names of folders, as in `shaders=built-in,my_shaders` on the command line.
x:axis("shaders", { "built-in" })
x:axis("size", { 64 })
x:axis("seconds", { 2 })
x:axis("reference", { 512 })

x:render(function(p)
  return {
    scene = "scenes/cornell.lua",
    integrator = "nee",
    max_depth = 6,
    resolution = { p.size, p.size },
    shaders = p.shaders,
  }
end)

-- A reference does not inherit `shaders`, so all folders are measured against the shaders of the program.
x:reference { stop = function(p) return stop.samples(p.reference) end }

x:measure { every = "0.25s", relmse = metric.relmse(), bias = metric.bias() }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = "relmse", by = "shaders" })
x:table("relmse", { value = "relmse", rows = "shaders" })
x:table("fps", { value = "fps", rows = "shaders" })

return x
