-- A hare that gives light back after a constant delay c: at once, one, and two units of optical length later.
--
--     lumbre run scripts/transient_constant.lua
--     lumbre run scripts/transient_constant.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.2 of thesis S2 (docs/bibliography.md). The walls are lit alike in all three; with c = 2 the hare is dark while they shine, and
-- shows at an optical length of 2 + t what it shows at t without a delay. The still pictures are the same.
--
-- A film with a time axis leaves its bins under films/ in the run's folder: time-cube.npy for programs, and for people
-- frames, animations, streaks, curves and a map of arrival. `lumbre run .. size=256 samples=1024` makes large ones.

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

return x
