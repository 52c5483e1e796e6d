-- scripts/copies_study.lua: instances of a mesh, stored once in a two-level BVH or expanded to
-- separate triangles.
--
--     lumbre run scripts/copies_study.lua
--
-- Both ways give the same picture up to rounding. If the mesh is stored once, an instance takes
-- the memory of a transform in place of its triangles, and every ray that enters it is transformed
-- to the space of the mesh. Rates are reliable on an idle machine only; memory and build times
-- depend less on other load. By default Lumbre stores meshes once in scenes of more than 2^20
-- triangles.
--
-- Results in out/latest, with a row per number of instances and a column per method:
--     tables/rays      million rays per second
--     tables/paths     million paths per second
--     tables/build     build time of the BVH in seconds
--     tables/memory    MiB of nodes and primitives

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
