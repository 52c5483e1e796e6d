-- Hierarchies: how fast paths are traced without one and with one, by whom it is built, and what bins and levels are worth.
--
--     lumbre run scripts/bvh_study.lua                          meshes of this project
--     lumbre run scripts/bvh_study.lua folder=/path/to/models   Suzanne, the Stanford bunny and the Stanford dragon
--
-- After sections 4.2 and 5.1 of the second source, which compares testing every triangle with its hierarchy on these three
-- models, cuts boxes by a plane or by the surface area heuristic over bins, and chooses 14 bins where more gain nothing.
-- `none`, `plane` and `sah` are its ways, `ploc` is what Lumbre uses otherwise and `cwbvh` the same builder's own
-- traversal. All but the first and the last are traversed by the same code.
--
-- Pictures have the same bits whoever builds, so only times differ: give it a quiet machine. Tables:
--
--     rates    million paths per second; the first two columns of interest are the source's table of 5.1.1
--     build    seconds spent building; over the bins, with `rates`, it is the source's figure 5.1
--     cost     what the surface area heuristic says of the tree, and so how well it predicts
--     memory   of nodes and primitives

local x = experiment("bvh_study", { seed = 51 })

local accels = {
  none = { builder = "none" },
  plane = { builder = "plane" },
  ["sah 14, depth 6"] = { builder = "sah", max_depth = 6 },
  ["sah 14, depth 12"] = { builder = "sah", max_depth = 12 },
  ["ploc fastest"] = { builder = "ploc", quality = "fastest" },
  ploc = { builder = "ploc" },
  ["ploc very slow"] = { builder = "ploc", quality = "very_slow" },
  cwbvh = { builder = "cwbvh" },
}
local order = { "none", "plane" }
for _, bins in ipairs { 2, 4, 6, 8, 10, 12, 14, 16, 24, 32 } do
  accels["sah " .. bins] = { builder = "sah", bins = bins }
  order[#order + 1] = "sah " .. bins
end
for _, name in ipairs { "sah 14, depth 6", "sah 14, depth 12", "ploc fastest", "ploc", "ploc very slow", "cwbvh" } do
  order[#order + 1] = name
end

-- An axis with one value is a switch: `folder=...` on the command line replaces it.
x:axis("folder", { "own" })
x:axis("accel", order)
x:axis("model", { "suzanne", "bunny", "dragon" })

x:render(function(p)
  return {
    scene = "scenes/model.lua",
    scene_options = { model = p.model, folder = p.folder ~= "own" and p.folder or "" },
    integrator = "bpt",
    accel = accels[p.accel],
    -- Without a hierarchy a picture of the dragon takes a while.
    resolution = p.accel == "none" and p.model ~= "suzanne" and { 64, 48 } or { 256, 192 },
  }
end)

x:measure { every = "0.5s" }
x:stop(stop.any { stop.samples(4096), stop.time("3s") })

x:table("rates", { value = "mpaths_s", rows = "accel", cols = "model" })
x:table("rays", { value = "mrays_s", rows = "accel", cols = "model" })
x:table("build", { value = "accel_build_s", rows = "accel", cols = "model" })
x:table("cost", { value = "accel_cost", rows = "accel", cols = "model" })
x:table("memory", { value = "accel_mib", rows = "accel", cols = "model" })

return x
