-- scripts/anisotropy_study.lua: directions of anisotropy from a texture, beside Mitsuba 3.
--
--     lumbre run scripts/anisotropy_study.lua
--     lumbre run scripts/anisotropy_study.lua python=/path/to/python    interpreter with Mitsuba
--
-- Thesis S0 ends with the wish to validate its anisotropy from textures (section 6.3,
-- docs/bibliography.md). Mitsuba has no textures of directions. A plate of 36 tiles is therefore
-- described twice: with such a texture, and by texture coordinates that are turned tile by tile,
-- which Mitsuba has as well. All three pictures must be equal up to noise; the column `none`, a
-- plate without anisotropy, shows how far another highlight is away.
--
-- Results in out/latest:
--     runs/**/final.png    the plate by each
--     tables/relmse        error against the plate with the texture, long rendered by `nee`
--     tables/flip          the difference that one sees

local x = experiment("anisotropy_study", { seed = 63 })

x:axis("python", { "python3" })
x:axis({ "technique", "directions" }, zip(
  { "nee", "nee", "external:mitsuba", "nee" },
  { "texture", "coordinates", "coordinates", "none" }
))
x:axis("size", { 192 })
x:axis("samples", { 256 })

x:render(function(p)
  local mitsuba = p.technique == "external:mitsuba"
  return {
    scene = "scripts/recipes/scenes/brushed_plate.lua",
    scene_options = { directions = p.directions },
    integrator = p.technique,
    python = mitsuba and p.python or nil,
    resolution = { p.size, p.size * 3 // 4 },
    max_depth = 2,
  }
end)

x:reference {
  from = function(p) return { integrator = "nee", scene_options = { directions = "texture" } } end,
  stop = function(p) return stop.samples(16 * p.samples) end,
}

x:measure { every = "1s", relmse = metric.relmse(), flip = metric.flip(), display = tonemap.srgb { exposure = -1 } }
x:stop(function(p) return stop.samples(p.samples) end)

x:table("relmse", { value = "relmse", rows = { "technique", "directions" } })
x:table("flip", { value = "flip", rows = { "technique", "directions" } })

return x
