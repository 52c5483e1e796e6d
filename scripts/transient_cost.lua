-- scripts/transient_cost.lua: the cost of a time axis, and of separable and composed materials, as
-- render time against samples.
--
--     lumbre run scripts/transient_cost.lua
--     lumbre run scripts/transient_cost.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.9 (docs/bibliography.md). `picture` is the picture alone, and `film` has a
-- time axis of 300 bins. `separable` and `composed` have the same bins and a hare of a material
-- with a delay. The four curves should be close to one another.
--
-- Results in out/latest:
--     tables/seconds   render time in seconds by samples per pixel and kind, mean of three repeats

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
  }
end)

x:measure { every = "60s" }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("seconds", { value = "render_s", rows = "samples", cols = "kind" })

return x
