-- scripts/theses/s0_section_6_3.lua: what the future work of thesis S0 gains.
--
--     lumbre run scripts/theses/s0_section_6_3.lua              2 minutes
--     lumbre run scripts/theses/s0_section_6_3.lua quick=true   20 seconds
--
-- Thesis S0 (docs/bibliography.md), section 6.3, expects fewer fireflies of light sampling with
-- weights, and cleaner pictures of few samples with a denoiser. No figure of the document shows
-- either. The scene has lamps from small to large over plates from smooth to rough, as in Veach
-- 1997, figure 9.2. All pictures have the same samples.

local x = experiment("s0_section_6_3", { seed = 2026, repeats = 5 })

local arms = {
  unweighted = { mis = "none", lights = "all", select = "area" },
  balance = { mis = "balance", lights = "all", select = "area" },
  power = { mis = "power", lights = "all", select = "area" },
  denoised = { mis = "power", lights = "all", select = "area", denoise = "atrous" },
}
x:axis("quick", { false })
x:axis("arm", { "unweighted", "balance", "power", "denoised" })

x:render(function(p)
  local render = { scene = "scenes/veach_mis.lua", view = "plates", integrator = "nee", max_depth = 5 }
  render.resolution = p.quick and { 96, 64 } or { 288, 192 }
  for key, value in pairs(arms[p.arm]) do render[key] = value end
  return render
end)
x:reference {
  from = function() return { integrator = "nee", mis = "power", denoise = "none" } end,
  stop = function(p) return stop.samples(p.quick and 1024 or 8192) end,
}
x:measure {
  every = "10s",
  rmse = metric.rmse { on = tonemap.srgb() },
  fireflies = metric.fireflies(),
  flip = metric.flip { on = tonemap.srgb() },
  display = tonemap.srgb(),
}
x:stop(function(p) return stop.samples(p.quick and 16 or 64) end)
for _, column in ipairs { "rmse", "fireflies", "flip" } do x:table(column, { value = column, rows = "arm" }) end
x:sheet("pictures", { cols = "arm" })
return x
