-- scripts/theses/s0_figure_4_13.lua: the strategies of bidirectional path tracing.
--
--     lumbre run scripts/theses/s0_figure_4_13.lua              3 minutes
--     lumbre run scripts/theses/s0_figure_4_13.lua quick=true   10 seconds
--     lumbre run scripts/theses/s0_figure_4_13.lua folder=/path/to/vkraytracing
--
-- Thesis S0 (docs/bibliography.md), section 4.11.1: figures 4.13 and 4.14, the picture of each
-- strategy for paths of up to six edges, without and with weights. The document: 1280x720, 10000
-- frames of each strategy alone. Here the layers of one run have all of them:
-- runs/**/films/pyramid-raw.png and pyramid-weighted.png.
--
-- `one` keeps only the strategies in which section 5.4.3 sees the reflection of the right lamp; it
-- measures what their weights leave of it.

local x = experiment("s0_figure_4_13", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("folder", { "own" })
x:axis("one", { "all", "s=0 t=3", "s=0 t=4", "s=1 t=3" })
x:axis("mis", { "power", "none" })
x:skip("the layers of all strategies have both", function(p) return p.one == "all" and p.mis == "none" end)

x:render(function(p)
  local own = p.folder == "own"
  local s, t = p.one:match("s=(%d) t=(%d)")
  return {
    scene = own and "scenes/veach_lamps.lua" or p.folder .. "/Bidirectional/veach_lamps_piramide.scn",
    view = own and "table" or nil,
    integrator = "bdpt",
    mis = p.mis,
    strategies = s and { tonumber(s), tonumber(t) } or nil,
    max_depth = 6,
    resolution = p.quick and { 64, 36 } or { 256, 144 },
    films = p.one == "all" and { "strategies" } or nil,
  }
end)
x:measure { every = "5s", display = tonemap.gamma { gamma = 2.2, exposure = 1 } }
x:report { display = tonemap.gamma { gamma = 2.2, exposure = 1 } }
x:stop(function(p) return stop.time(p.quick and 0.5 or 5) end)
return x
