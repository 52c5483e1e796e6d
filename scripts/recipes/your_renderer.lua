-- scripts/recipes/your_renderer.lua: a renderer of one's own beside the techniques of Lumbre.

local x = experiment("your_renderer", { seed = 21 })

-- Parameters are placeholders of the command, and keys of the render table.
local toy = external {
  name = "toy",
  params = { python = "python3" },
  command = {
    "{python}", "{folder}/toy_renderer.py",
    "{scene}", "{width}", "{height}", "{depth}", "{spp}", "{seed}", "{out}",
  },
  version = { "{python}", "--version" },
  picture = "pfm",
  time = "json",
  timeout = "5min",
}

x:axis("technique", { "bpt", toy })
x:axis("size", { 24 })
x:axis("samples", { 16 })

x:render(function(p)
  return { scene = "scenes/two_spheres.lua", integrator = p.technique, resolution = { p.size, p.size } }
end)

x:reference {
  from = function() return { integrator = "bpt" } end,
  stop = function(p) return stop.samples(64 * p.samples) end,
}

x:measure { every = "5s", rmse = metric.rmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "samples", y = { "rmse" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("seconds", { value = "render_s", rows = "technique" })

return x
