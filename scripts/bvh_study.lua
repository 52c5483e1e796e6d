-- Hierarchies: how fast paths are traced without one and with one, by whom it is built, and what bins and levels are worth.
--
--     lumbre run scripts/bvh_study.lua                          meshes of this project
--     lumbre run scripts/bvh_study.lua folder=/path/to/models   Suzanne, the Stanford bunny and the Stanford dragon
--
-- After sections 4.2 and 5.1 of thesis S1 (docs/bibliography.md), which compares testing every triangle with its hierarchy on these three
-- models, cuts boxes by a plane or by the surface area heuristic over bins, and chooses 14 bins where more gain nothing.
-- `none`, `plane` and `sah` are its ways, `ploc` is what Lumbre uses otherwise and `cwbvh` the same builder's own
-- traversal. All but the first and the last are traversed by the same code.
--
-- Every builder gives the same bits, so only times differ: run it on an idle machine. `--backend vulkan-compute` builds
-- the same trees for a device. Tables and figures:
--
--     rates     million paths per second; `none` and `sah` are the columns of the source's table of 5.1.1
--     build     seconds spent building
--     cost      what the surface area heuristic says of the tree, and so how well it predicts
--     memory    of nodes and primitives
--     bins      the source's figure 5.1: times to build, rates and costs over the number of bins
--     builders  the same by builder, as in the measurements at the end of its 4.2.1

local x = experiment("bvh_study", { seed = 51, repeats = 3 })

local accels = {
  none = { builder = "none" },
  plane = { builder = "plane" },
  sah = { builder = "sah" },
  ["sah, 12 levels"] = { builder = "sah", max_depth = 12 },
  ["sah, 6 levels"] = { builder = "sah", max_depth = 6 },
  ["ploc fastest"] = { builder = "ploc", quality = "fastest" },
  ploc = { builder = "ploc" },
  ["ploc very slow"] = { builder = "ploc", quality = "very_slow" },
  cwbvh = { builder = "cwbvh" },
}

-- An axis with one value is a switch: `folder=...` on the command line replaces it.
x:axis("folder", { "own" })
x:axis("accel", {
  "none", "plane", "sah", "sah, 12 levels", "sah, 6 levels", "ploc fastest", "ploc", "ploc very slow", "cwbvh",
})
x:axis("bins", { 2, 4, 6, 8, 10, 12, 14, 16, 24, 32 })
x:axis("model", { "suzanne", "bunny", "dragon" })
x:skip("only the first kind of sah is built with other bins than 14", function(p)
  return p.accel ~= "sah" and p.bins ~= 14
end)

x:render(function(p)
  local accel = {}
  for key, value in pairs(accels[p.accel]) do accel[key] = value end
  if accel.builder == "sah" then accel.bins = p.bins end
  return {
    scene = "scenes/model.lua",
    scene_options = { model = p.model, folder = p.folder ~= "own" and p.folder or "" },
    integrator = "bpt",
    accel = accel,
    -- Without a hierarchy a picture of the dragon takes a while.
    resolution = p.accel == "none" and p.model ~= "suzanne" and { 64, 48 } or { 256, 192 },
  }
end)

x:measure { every = "0.5s" }
x:stop(stop.any { stop.samples(4096), stop.time("2s") })

x:table("rates", { value = "mpaths_s", rows = { "accel", "bins" }, cols = "model" })
x:table("rays", { value = "mrays_s", rows = { "accel", "bins" }, cols = "model" })
x:table("build", { value = "accel_build_s", rows = { "accel", "bins" }, cols = "model" })
x:table("cost", { value = "accel_cost", rows = { "accel", "bins" }, cols = "model" })
x:table("memory", { value = "accel_mib", rows = { "accel", "bins" }, cols = "model" })
x:figure("bins", {
  x = "bins", y = { "accel_build_s", "mpaths_s", "accel_cost" }, by = "model", only = { accel = "sah" },
})
x:figure("builders", {
  x = "accel", y = { "accel_build_s", "mpaths_s", "accel_cost" }, by = "model", only = { bins = 14 },
})

return x
