-- scripts/chlorophyll.lua: a material that reflects green light without delay and red light after
-- one unit of optical length, with weights of 30 % and 70 % for green.
--
--     lumbre run scripts/chlorophyll.lua
--     lumbre run scripts/chlorophyll.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.6 (docs/bibliography.md). The material is composed of "hare_green" and
-- "hare_red"; their weights are an axis here. At every vertex a path selects one of the two with
-- the probability of its weight.
--
-- Results in out/latest:
--     runs/**/films/time-*    frames, animation, streaks and curves over optical length
--     runs/**/final.png       the picture without time

local x = experiment("chlorophyll", { seed = 2 })

x:axis("green", { 0.3, 0.7 })
x:axis("model", { "hare" })
x:axis("size", { 128 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { hare = "chlorophyll", bunny = p.model ~= "hare" and p.model or "" },
    view = "hare",
    integrator = "nee",
    resolution = { p.size, p.size },
    set = { ["materials.hare.weights"] = { p.green, 1 - p.green } },
    film = { time = { start = 2, bin = 0.05, bins = 140, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
