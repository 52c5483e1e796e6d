-- scripts/masking.lua: how the mode and the threshold of a mask change the shape of a masked leaf.
--
--     lumbre run scripts/masking.lua
--
-- After the paragraph on masking in thesis S0, section 4.8.5, and its annex A.3
-- (docs/bibliography.md), where a hit is ignored if the mask is below one half. The mask of these
-- leaves has soft edges and thin veins: a low threshold keeps the soft rim, and a high one removes
-- the veins. In the mode `blend` the mask is a coverage: the edge of a leaf transmits part of the
-- light, shadows have the same soft edges, and the threshold has no effect.
--
-- Results in out/latest:
--     runs/**/final.png   the leaves with each mode and threshold
--     tables/rmse         RMSE against the rule of thesis S0, by mode and threshold

local x = experiment("masking", { seed = 5 })

x:axis("mode", { "threshold", "blend" })
x:axis("threshold", { 0.1, 0.3, 0.5, 0.7, 0.9 })

-- `blend` ignores the threshold, so one cell is enough.
x:skip("blend has no threshold", function(p)
  return p.mode == "blend" and p.threshold ~= 0.5
end)

local function picture(mode, threshold)
  return {
    scene = "scenes/masked_leaves/masked_leaves.scn",
    integrator = "nee",
    resolution = { 192, 144 },
    set = {
      ["materials.leaf.mask_mode"] = mode,
      ["materials.leaf.mask_threshold"] = threshold,
    },
  }
end

x:render(function(p)
  return picture(p.mode, p.threshold)
end)

-- The reference of every cell follows the rule of thesis S0, so the error measures the effect of
-- the mode and the threshold.
x:reference {
  from = function()
    return picture("threshold", 0.5)
  end,
  stop = stop.samples(512),
}

x:measure { every = "1s", rmse = metric.rmse() }
x:stop(stop.samples(128))

x:table("rmse", { value = "rmse", rows = "mode", cols = "threshold" })

return x
