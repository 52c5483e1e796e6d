-- scripts/transient_constant.lua: a hare that re-emits light after a constant delay c of 0, 1 or 2
-- units of optical length.
--
--     lumbre run scripts/transient_constant.lua
--     lumbre run scripts/transient_constant.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.2 (docs/bibliography.md). Light from the walls arrives at the same time in
-- all three runs. With c = 2 the hare is dark meanwhile, and at an optical length of 2 + t it shows
-- what it shows at t without a delay. The pictures without time are identical.
--
-- Results in out/latest; `size=256 samples=1024` makes large ones:
--     sheets/delays.svg, .png, .pdf   density, picture without time, and frames of each delay
--     runs/**/films/time-cube.npy   mean radiance of every bin
--     runs/**/films/time-*          frames, animations, streaks, curves and a map of arrival times
--     runs/**/final.png             the picture without time

local x = experiment("transient_constant", { seed = 2 })

x:axis("c", { 0, 1, 2 })
x:axis("model", { "hare" })
x:axis("size", { 96 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { bunny = p.model ~= "hare" and p.model or "" },
    view = "front",
    integrator = "nee",
    resolution = { p.size, p.size },
    set = { ["materials.hare.delay"] = "constant", ["materials.hare.delay_constant"] = p.c },
    film = { time = { start = 3.5, bin = 0.05, bins = 170, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:frames("delays", {
  rows = "c",
  at = { 4.5, 5.5, 6.5, 7.5, 8.5 },
  density = "hare",
  static = true,
})

return x
