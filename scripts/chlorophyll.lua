-- Chlorophyll: green light at once, red light one unit of optical length later, with 30 % and 70 % of green.
--
--     lumbre run scripts/chlorophyll.lua
--     lumbre run scripts/chlorophyll.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.6 of thesis S2 (docs/bibliography.md). The material is composed of two: { "hare_green", "hare_red" } with weights that are an
-- axis here. A path sees one part of it at every vertex, with its weight as probability.

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
