-- scripts/recipes/switch_parts.lua: parts of a renderer, switched off one at a time.

local x = experiment("switch_parts", { seed = 33 })

x:axis("without", { "nothing", "texture filter", "smooth normals", "environment sampling", "bsdf sampling" })
x:axis("size", { 64 })
x:axis("samples", { 16 })

x:render(function(p)
  local off = function(part) return p.without == part end
  return {
    scene = "scenes/material_ball.lua",
    scene_options = { shape = "facets", light = "sky" },
    integrator = "nee",
    directions = off "bsdf sampling" and "uniform" or "bsdf",
    max_depth = 4,
    resolution = { p.size, p.size },
    set = {
      ["materials.ball.metallic"] = 1,
      ["materials.ball.roughness"] = 0.3,
      ["materials.*.texture_filter"] = off "texture filter" and "nearest" or "given",
      ["materials.*.shading_normals"] = off "smooth normals" and "flat" or "smooth",
      ["environment.sampling"] = off "environment sampling" and "uniform" or "luminance",
    },
  }
end)

-- A filter and normals change the picture, and each cell is measured against its own. Samplings do
-- not, so the reference has the better ones.
x:reference {
  from = function(p) return { directions = "bsdf", set = { ["environment.sampling"] = "luminance" } } end,
  stop = function(p) return stop.samples(16 * p.samples) end,
}

-- The sun lights the floor to more than white.
x:measure { every = "10s", rmse = metric.rmse(), display = tonemap.srgb { exposure = -1 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("rmse", { value = "rmse", rows = "without" })
x:table("rate", { value = "mpaths_s", rows = "without" })

return x
