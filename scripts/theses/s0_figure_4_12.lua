-- scripts/theses/s0_figure_4_12.lua: leaves and chains cut out by masks.
--
--     lumbre run scripts/theses/s0_figure_4_12.lua              1 minute
--     lumbre run scripts/theses/s0_figure_4_12.lua quick=true   5 seconds
--
-- Thesis S0 (docs/bibliography.md), section 4.8.5 and annex A.3: figure 4.12, leaves and chains of
-- Sponza whose outlines are masks on simple polygons. Here: five leaves of this project, with the
-- rule of the document (a hit below one half is ignored) and with a threshold of zero, which cuts
-- nothing out.
--
-- The mask has soft edges and thin veins: with `threshold=0.1,0.3,0.5,0.7,0.9` a low threshold keeps
-- the soft rim, and a high one removes the veins. With `mode=blend` the mask is a coverage: edges
-- transmit part of the light, their shadows are as soft, and the threshold has no effect.

local x = experiment("s0_figure_4_12", { seed = 2026, repeats = 5 })

x:axis("quick", { false })
x:axis("mode", { "threshold" })
x:axis("threshold", { 0, 0.5 })

x:render(function(p)
  return {
    scene = "scenes/masked_leaves/masked_leaves.scn",
    integrator = "nee",
    max_depth = 5,
    resolution = p.quick and { 64, 48 } or { 256, 192 },
    set = { ["materials.leaf.mask_mode"] = p.mode, ["materials.leaf.mask_threshold"] = p.threshold },
  }
end)
x:measure { every = "1s", display = tonemap.gamma { gamma = 2.2 } }
x:stop(function(p) return stop.samples(p.quick and 64 or 512) end)
x:sheet("leaves", { rows = "mode", cols = "threshold" })
return x
