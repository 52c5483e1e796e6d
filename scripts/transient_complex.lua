-- scripts/transient_complex.lua: a composed material of two colours with a delay from a texture.
-- Light returns in four steps: blue and yellow from black patches, then blue and yellow from white.
--
--     lumbre run scripts/transient_complex.lua
--     lumbre run scripts/transient_complex.lua model=/path/to/stanford-bunny.obj
--
-- `model` is another mesh that replaces the hare.
--
-- Thesis S2, figure 6.7 (docs/bibliography.md): both parts of the composed material take their
-- delay from the texture.
--
-- Results in out/latest:
--     runs/**/films/time-*    frames, animation, streaks and curves over optical length
--     runs/**/final.png       the picture without time

local x = experiment("transient_complex", { seed = 2 })

x:axis("model", { "hare" })
x:axis("size", { 128 })
x:axis("samples", { 384 })

x:render(function(p)
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { hare = "complex", bunny = p.model ~= "hare" and p.model or "" },
    view = "hare",
    integrator = "nee",
    resolution = { p.size, p.size },
    film = { time = { start = 2, bin = 0.05, bins = 180, metres = 1 } },
  }
end)

x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

return x
