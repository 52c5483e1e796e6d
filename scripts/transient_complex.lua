-- Two colours and two patches, four moments: blue and yellow light of black patches, then blue and yellow of white ones.
--
--     lumbre run scripts/transient_complex.lua
--     lumbre run scripts/transient_complex.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.7 of thesis S2 (docs/bibliography.md): a composed material whose parts both take their delay from a texture.

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
