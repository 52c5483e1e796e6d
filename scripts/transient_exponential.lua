-- A hare that gives light back with an exponential profile: without one, of rate 2, and of rate 0.5.
--
--     lumbre run scripts/transient_exponential.lua
--     lumbre run scripts/transient_exponential.lua model=/path/to/stanford-bunny.obj   another mesh in place of the hare
--
-- Figure 6.3 of thesis S2 (docs/bibliography.md): a high rate gives nearly all light back soon, a low one spreads it over the time after.

local x = experiment("transient_exponential", { seed = 2 })

-- 0 stands for no profile.
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

return x
