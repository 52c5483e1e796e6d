-- Masking: how the threshold of a mask, and its mode, decide what a cut-out leaf looks like.
--
--     lumbre run scripts/masking.lua
--
-- After the paragraph on masking in section 4.8.5, and annex A.3, of "Codificación de algoritmos de trazado de rayos en
-- Vulkan", where a hit is no hit if the mask is below one half. The mask of these leaves has soft edges and thin veins:
-- a low threshold keeps its blurred rim, a high one eats the veins away. In the mode `blend` the mask is a coverage
-- instead: a leaf's edge lets part of the light through, the shadows have the same soft edges, and no threshold is asked.

local x = experiment("masking", { seed = 5 })

x:axis("mode", { "threshold", "blend" })
x:axis("threshold", { 0.1, 0.3, 0.5, 0.7, 0.9 })

-- Blending asks no threshold, so that one cell says it all.
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

-- The truth of every cell is the picture that the source's rule gives, so that the error says how far the rule decides.
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
