-- scripts/texture_filter.lua: filtered and unfiltered textures, and what the filter costs.
--
--     lumbre run scripts/texture_filter.lua
--
-- After thesis S1, section 3.2.3 and figure 3.8 (docs/bibliography.md), which compares the rate of
-- paths with and without the interpolation of texels. The view is close to the floor, whose texture
-- is magnified: without the filter its texels are squares.
--
-- `materials.*.texture_filter` sets the filter of all textures of a scene; a scene file can also
-- give it for each (`NEAREST` in glTF, `filter_type` in Mitsuba, `filter` of `texture.lay`).
--
-- Every filter has its own picture, so each cell has a reference of its own, and errors are noise.
-- Rates differ by a few percent: run this on an idle machine.
--
-- Results in out/latest:
--     runs/**/final.png    the floor with each filter
--     tables/rate          million paths per second by filter
--     tables/rmse          noise after the same samples

local x = experiment("texture_filter", { seed = 38, repeats = 3 })

x:axis("filter", { "bilinear", "nearest" })
x:axis("size", { 256 })
x:axis("samples", { 256 })

x:render(function(p)
  return {
    scene = "scenes/material_ball.lua",
    view = "floor",
    integrator = "nee",
    max_depth = 3,
    resolution = { p.size, p.size * 3 // 4 },
    set = { ["materials.*.texture_filter"] = p.filter },
  }
end)

x:reference { stop = function(p) return stop.samples(4 * p.samples) end }

x:measure { every = "0.5s", rmse = metric.rmse(), display = tonemap.srgb { exposure = 0 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("rate", { value = "mpaths_s", rows = "filter" })
x:table("rmse", { value = "rmse", rows = "filter" })

return x
