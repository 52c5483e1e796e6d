-- scripts/transient_exponential.lua: a hare that re-emits light without a delay, and with an
-- exponential profile of rate 2 and 0.5.
--
--     lumbre run scripts/transient_exponential.lua
--     lumbre run scripts/transient_exponential.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.3 (docs/bibliography.md): with a high rate nearly all light returns soon,
-- with a low rate it spreads over a longer time.
--
-- Results in out/latest:
--     sheets/delays.*         density, picture without time, and frames of each profile
--     runs/**/films/time-*    frames, animation, streaks and curves over optical length
--     runs/**/final.png       the picture without time

local x = experiment("transient_exponential", { seed = 2 })

-- Rate per unit of optical length; 0 means no profile.
x:axis("rate", { 0, 2, 0.5 })
x:axis("model", { "hare" })
x:axis("size", { 96 })
x:axis("samples", { 256 })

x:render(function(p)
  local delayed = { ["materials.hare.delay"] = "exponential", ["materials.hare.delay_rate"] = p.rate }
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { bunny = p.model ~= "hare" and p.model or "" },
    view = "front",
    integrator = "nee",
    resolution = { p.size, p.size },
    set = p.rate > 0 and delayed or {},
    film = { time = { start = 3.5, bin = 0.05, bins = 170, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:frames("delays", {
  rows = "rate",
  at = { 4.5, 5.5, 6.5, 7.5, 8.5 },
  density = "hare",
  static = true,
})

return x
