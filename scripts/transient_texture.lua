-- scripts/transient_texture.lua: a hare with patches: black ones re-emit light without a delay,
-- white ones after one unit of optical length.
--
--     lumbre run scripts/transient_texture.lua
--     lumbre run scripts/transient_texture.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.5 (docs/bibliography.md). The picture without time shows no patches, because
-- they differ in their delay only.
--
-- Results in out/latest:
--     runs/**/films/time-*    frames, animation, streaks and curves over optical length
--     runs/**/final.png       the picture without time

local x = experiment("transient_texture", { seed = 2 })

x:axis("model", { "hare" })
x:axis("size", { 128 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { hare = "patches", bunny = p.model ~= "hare" and p.model or "" },
    view = "hare",
    integrator = "nee",
    resolution = { p.size, p.size },
    film = { time = { start = 2, bin = 0.05, bins = 140, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
