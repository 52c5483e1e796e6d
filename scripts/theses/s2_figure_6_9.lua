-- scripts/theses/s2_figure_6_9.lua: cost of materials with delays.
--
--     lumbre run scripts/theses/s2_figure_6_9.lua              5 minutes
--     lumbre run scripts/theses/s2_figure_6_9.lua quick=true   20 seconds
--     lumbre run scripts/theses/s2_figure_6_9.lua model=/path/to/stanford-bunny.obj
--
-- Thesis S2 (docs/bibliography.md), section 6.3: figure 6.9, render time over samples of each
-- pixel: before the change, and after it without delays, with a separable and with a composed
-- material. `picture` has no axis of time; `film` has one and no delay.

local s2 = require("lib.s2")
local x = experiment("s2_figure_6_9", { seed = 2026, repeats = 5 })

s2.axes(x)
x:axis("kind", { "picture", "film", "separable", "composed" })
x:axis("spp", { 16, 32, 64, 128 })
x:render(function(p)
  local delay = p.kind == "separable" and { delay = "exponential", delay_rate = 2 } or {}
  local render = s2.picture(p, delay, p.kind == "composed" and "chlorophyll" or "plain")
  if p.kind == "picture" then render.film = nil end
  return render
end)
x:measure { every = "60s" }
x:stop(function(p) return stop.samples(p.spp) end)
x:figure("seconds", { x = "spp", y = "render_s", by = "kind" })
x:table("seconds", { value = "render_s", rows = "spp", cols = "kind" })
return x
