-- scripts/theses/lib/s2.lua: the box with the hare of thesis S2, chapter 6, for the scripts in
-- scripts/theses/ (docs/bibliography.md).

local s2 = {}

-- Declares the axes that all figures of the box have.
function s2.axes(x)
  x:axis("quick", { false })
  x:axis("model", { "hare" })
end

-- Returns the render table of the box. `set` gives parameters of the hare's material without
-- `materials.hare.`, `kind` the option `hare` of the scene. The axis of time starts with the flash
-- and leaves out the way to the camera.
function s2.picture(p, set, kind, view)
  local changes = {}
  for name, value in pairs(set or {}) do changes["materials.hare." .. name] = value end
  return {
    scene = "scenes/hare_box.lua",
    scene_options = { hare = kind or "plain", bunny = p.model ~= "hare" and p.model or "" },
    view = view or "front",
    integrator = "nee",
    resolution = p.quick and { 48, 48 } or { 128, 128 },
    set = changes,
    film = { time = { bin = 0.05, bins = 200, camera = false, metres = 1 } },
  }
end

-- Declares what the figures measure and when their runs end.
function s2.measure(x)
  x:measure { every = "5s", display = tonemap.srgb { exposure = 0 } }
  x:stop(function(p) return stop.samples(p.quick and 128 or 1024) end)
end

return s2
