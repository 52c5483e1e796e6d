-- Copies of a mesh: kept once and found through a hierarchy of two levels, or each with triangles of its own.
--
--     lumbre run scripts/copies_study.lua
--
-- Both make the same picture but for the last digits. Kept once, a copy costs a place instead of its triangles, and rays
-- pay for the way into its mesh's space and back. Rates are worth something on a quiet machine only; memory and the time
-- to build are not that particular. Left to itself Lumbre keeps meshes once from 2^20 triangles on.

local x = experiment("copies_study", { seed = 81 })

x:axis("copies", { 100, 1600, 10000 })
x:axis("instances", { "never", "always" })

x:render(function(p)
  return {
    scene = "scenes/instances.lua",
    scene_options = { count = p.copies },
    integrator = "bpt",
    max_depth = 5,
    resolution = { 320, 180 },
    accel = { instances = p.instances },
  }
end)

x:measure { every = "1s" }
x:stop(stop.any { stop.samples(64), stop.time("10s") })

x:table("rays", { value = "mrays_s", rows = "copies", cols = "instances" })
x:table("paths", { value = "mpaths_s", rows = "copies", cols = "instances" })
x:table("build", { value = "accel_build_s", rows = "copies", cols = "instances" })
x:table("memory", { value = "accel_mib", rows = "copies", cols = "instances" })

return x
