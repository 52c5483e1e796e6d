-- scripts/theses/s1_table_4_2.lua: acceleration structures.
--
--     lumbre run scripts/theses/s1_table_4_2.lua                         8 minutes
--     lumbre run scripts/theses/s1_table_4_2.lua quick=true              90 seconds
--     lumbre run scripts/theses/s1_table_4_2.lua models=/path/to/models  Suzanne, Stanford bunny, dragon
--
-- Thesis S1 (docs/bibliography.md): the tables of section 4.2.2 (build time and paths a second of
-- splits at a plane and by the surface area heuristic), the table of section 5.1.1 (without and
-- with a hierarchy), and figures 4.7 to 4.9 (the models). The document: 968, 4968 and 871306
-- triangles on a graphics card, 14 bins, 18 levels as its log in section 7.1.2 states.
--
-- `plane_z` is the split by plane as Listing 4.6 does it: its vector of lengths is a comma
-- expression, so it always splits along z. `plane` splits the longest side, as the text states.
-- Knots of this project replace the models unless `models` is given. Beside the document's methods:
-- `ploc`, the default, and `cwbvh`, whose nodes are compressed, both of the package obvhs. All but
-- `none` and `cwbvh` have the same traversal, and all give the same picture, so that only times
-- differ: run this on an idle machine.

local x = experiment("s1_table_4_2", { seed = 2026, repeats = 5 })

local accels = {
  none = { builder = "none" },
  plane_z = { builder = "plane_z", max_depth = 18 },
  plane = { builder = "plane", max_depth = 18 },
  sah = { builder = "sah", bins = 14, max_depth = 18 },
  ploc = { builder = "ploc" },
  cwbvh = { builder = "cwbvh" },
}
x:axis("quick", { false })
x:axis("models", { "own" })
x:axis("model", { "suzanne", "bunny", "dragon" })
x:axis("accel", { "none", "plane_z", "plane", "sah", "ploc", "cwbvh" })

x:render(function(p)
  return {
    scene = "scenes/model.lua",
    scene_options = { model = p.model, folder = p.models ~= "own" and p.models or "" },
    integrator = "bpt",
    accel = accels[p.accel],
    resolution = p.accel == "none" and p.model ~= "suzanne" and { 32, 24 } or p.quick and { 128, 96 } or { 256, 192 },
  }
end)
x:measure { every = "1s", display = tonemap.srgb() }
x:stop(function(p) return stop.time(p.quick and 0.5 or 4) end)
x:table("build", { value = "accel_build_s", rows = "model", cols = "accel" })
x:table("rates", { value = "mpaths_s", rows = "model", cols = "accel" })
x:table("rays", { value = "mrays_s", rows = "model", cols = "accel" })
x:table("cost", { value = "accel_cost", rows = "model", cols = "accel" })
x:table("memory", { value = "accel_mib", rows = "model", cols = "accel" })
x:sheet("models", { rows = "accel", cols = "model" })
return x
