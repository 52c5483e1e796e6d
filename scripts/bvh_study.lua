-- scripts/bvh_study.lua: path rates without a BVH and with one from each builder, and the effect of
-- the number of bins and levels.
--
--     lumbre run scripts/bvh_study.lua                          knots of this project as models
--     lumbre run scripts/bvh_study.lua folder=/path/to/models   Suzanne, Stanford bunny and dragon
--
-- After thesis S1, sections 4.2 and 5.1 (docs/bibliography.md). For the three models in `folder`,
-- the thesis compares tests of every triangle with a BVH that is built by splits at a plane or by
-- the surface area heuristic (SAH) over bins. It selects 14 bins, because more gain nothing.
-- `none`, `plane` and `sah` are its methods; `plane_z` is the split by plane as its listing prints
-- it, always along z and to a fixed depth. `ploc`, the default of Lumbre, and `cwbvh`, which
-- traverses compressed nodes, are built by obvhs. All except `none` and `cwbvh` use the same
-- traversal.
--
-- Every builder gives the same picture, bit for bit, so only times differ: run this on an idle
-- machine. `--backend vulkan-compute` builds the same trees for a device.
--
-- Results in out/latest, one column or line per model:
--     tables/rates        million paths per second; `none` and `sah` are the columns of the table
--                         in thesis S1, section 5.1.1
--     tables/rays         million rays per second
--     tables/build        build time in seconds
--     tables/cost         SAH cost of the tree, to compare its prediction with the rates
--     tables/memory       MiB of nodes and primitives
--     figures/bins*       thesis S1, figure 5.1: build time, rate and cost over the number of bins
--     figures/builders*   the same over builders, as at the end of thesis S1, section 4.2.1

local x = experiment("bvh_study", { seed = 51, repeats = 3 })

local accels = {
  none = { builder = "none" },
  plane = { builder = "plane" },
  ["plane_z, 12 levels"] = { builder = "plane_z", max_depth = 12 },
  sah = { builder = "sah" },
  ["sah, 12 levels"] = { builder = "sah", max_depth = 12 },
  ["sah, 6 levels"] = { builder = "sah", max_depth = 6 },
  ["ploc fastest"] = { builder = "ploc", quality = "fastest" },
  ploc = { builder = "ploc" },
  ["ploc very slow"] = { builder = "ploc", quality = "very_slow" },
  cwbvh = { builder = "cwbvh" },
  ["cwbvh very slow"] = { builder = "cwbvh", quality = "very_slow" },
}

-- An axis with one value can be replaced on the command line: `folder=...`.
x:axis("folder", { "own" })
x:axis("accel", {
  "none", "plane", "plane_z, 12 levels", "sah", "sah, 12 levels", "sah, 6 levels", "ploc fastest", "ploc",
  "ploc very slow", "cwbvh", "cwbvh very slow",
})
x:axis("bins", { 2, 4, 6, 8, 10, 12, 14, 16, 24, 32 })
x:axis("model", { "suzanne", "bunny", "dragon" })
x:skip("the number of bins varies only for `sah` without a limit of levels", function(p)
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
    -- Without a BVH a full-size picture of the bunny or the dragon would take too long.
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
