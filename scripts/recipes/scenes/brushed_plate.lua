-- A metal plate of 36 tiles, each brushed in another direction, under a lamp.
--
-- Option `directions`: `texture`, where one quad has a texture of directions, one texel for each
-- tile; or `coordinates`, where every tile has texture coordinates turned in its direction and the
-- material has no texture. Both describe the same plate, and the second needs no textures of
-- directions, so that other renderers can have it too. `none` is a plate without a direction.

local s = scene { resolution = { 192, 144 }, max_depth = 2 }
local directions = s:option("directions", { "texture", "coordinates", "none" })
local n = 6

s:view("plate", { position = { 0, 2.4, 2.6 }, target = { 0, 0, 0 }, fov = 40 })
s:view("low", { position = { 1.9, 0.9, 1.9 }, target = { 0, 0, 0 }, fov = 40 })

-- The direction of a tile as an angle from the direction of increasing u, from 0 to 180 degrees.
local function angle(column, row) return math.pi * (column + n * row) / (n * n) end

local metal = {
  model = "conductor", eta = { 1.66, 0.88, 0.52 }, k = { 9.22, 6.27, 4.84 },
  roughness = 0.5, anisotropic = directions == "none" and 0 or 0.9,
}
if directions == "texture" then
  local painted = texture.paint { size = { n, n }, linear = true, color = function(u, v)
    local a = angle(math.floor(u * n), math.floor(v * n))
    return 0.5 + 0.5 * math.cos(a), 0.5 + 0.5 * math.sin(a), 0.5
  end }
  metal.anisotropic_direction_texture = texture.lay(painted, { filter = "nearest", wrap = "clamp" })
end
s:material("metal", metal)
s:material("lamp", { emission = { 30, 30, 30 }, emitter_reflects = false })

-- The plate from -1 to 1; u grows along +x, v along -z.
local function corner(u, v) return { 2 * u - 1, 0, 1 - 2 * v } end
local positions, uvs, triangles = {}, {}, {}
for row = 0, n - 1 do
  for column = 0, n - 1 do
    local a, first = angle(column, row), #positions
    local turned = directions == "coordinates"
    for _, at in ipairs { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } } do
      local u, v = (column + at[1]) / n, (row + at[2]) / n
      positions[#positions + 1] = corner(u, v)
      uvs[#uvs + 1] = turned
        and { math.cos(a) * u + math.sin(a) * v, math.cos(a) * v - math.sin(a) * u }
        or { u, v }
    end
    triangles[#triangles + 1] = { first + 1, first + 2, first + 3 }
    triangles[#triangles + 1] = { first + 1, first + 3, first + 4 }
  end
end
s:add { name = "plate", shape = shape.mesh { positions = positions, triangles = triangles, uvs = uvs }, material = "metal" }
s:add {
  name = "lamp", shape = shape.grid { size = { 0.5, 0.5 } }, material = "lamp",
  at = { -0.4, 1.6, -1 }, rotate = { 180, 0, 0 },
}

return s
