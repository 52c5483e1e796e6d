-- What time costs: render time against samples without a time axis, with one, and with separable and composed materials.
--
--     lumbre run scripts/transient_cost.lua
--     lumbre run scripts/transient_cost.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.9 of thesis S2 (docs/bibliography.md). `film` compares the picture alone with a film of 300 bins; `separable` and `composed` are
-- films of the same bins with a hare that gives light back late. The curves should lie close to one another.

local x = experiment("transient_cost", { seed = 2, repeats = 3 })

x:axis("kind", { "picture", "film", "separable", "composed" })
x:axis("model", { "hare" })
x:axis("integrator", { "nee" })
x:axis("samples", { 16, 32, 64 })

x:render(function(p)
  local time = { time = { start = 4, bin = 0.03, bins = 300 } }
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { hare = p.kind == "composed" and "chlorophyll" or "plain", bunny = p.model ~= "hare" and p.model or "" },
    view = "front",
    integrator = p.integrator,
    resolution = { 128, 128 },
    set = p.kind == "separable" and { ["materials.hare.delay"] = "exponential", ["materials.hare.delay_rate"] = 2 } or {},
    film = p.kind ~= "picture" and time or {},
    -- One by one in all four, since materials that give light back late do not go in lanes: only time is to be compared.
    accel = { lanes = "never" },
  }
end)

x:measure { every = "60s" }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("seconds", { value = "render_s", rows = "samples", cols = "kind" })

return x
