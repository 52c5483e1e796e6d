-- A hare with patches: black ones give light back at once, white ones one unit of optical length later.
--
--     lumbre run scripts/transient_texture.lua
--     lumbre run scripts/transient_texture.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.5 of thesis S2 (docs/bibliography.md). In the still picture there are no patches: only time tells them apart.

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
