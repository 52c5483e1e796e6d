-- scripts/recipes/other_renderers.lua: Mitsuba, LuxCore and Cycles beside the techniques of Lumbre, at equal time.

local x = experiment("other_renderers", { seed = 22, repeats = 3 })

-- Bridges in Python: servers that read the exported scene.
local function bridge(name, package, words, version)
  local command = { "{python}", "{folder}/" .. name .. "_bridge.py" }
  for _, word in ipairs(words) do command[#command + 1] = word end
  return external {
    name = package,
    params = { python = "python3" },
    command = command,
    version = { "{python}", "{folder}/package_version.py", version },
    serve = true,
    picture = name == "luxcore" and "pfm" or "exr",
    timeout = "10min",
  }
end
local scene = { "{scene}", "{width}", "{height}", "{depth}", "{threads}" }
local path = bridge("luxcore", "luxcore-path", { "PATHCPU", table.unpack(scene) }, "pyluxcore")
local bidir = bridge("luxcore", "luxcore-bidir", { "BIDIRCPU", table.unpack(scene) }, "pyluxcore")
local cycles = bridge("cycles", "cycles", scene, "bpy")

x:axis("technique", { "nee", "bdpt", "external:mitsuba", path, bidir, cycles })
-- Interpreters that have the packages.
x:axis("python", { "python3" })
x:axis("mitsuba", { "python3" })
x:axis("size", { 48 })
x:axis("seconds", { 4 })
x:axis("reference", { 4096 })

x:render(function(p)
  local own = p.technique == "nee" or p.technique == "bdpt"
  local python = p.technique == "external:mitsuba" and p.mitsuba or p.python
  return {
    scene = "scenes/two_spheres.lua",
    integrator = p.technique,
    python = not own and python or nil,
    resolution = { p.size, p.size },
    max_depth = 5,
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(p.reference) end,
}

x:measure { every = "1s", rmse = metric.rmse(), bias = metric.bias(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.time(p.seconds) end)

x:figure("convergence", { x = "render_s", y = { "rmse" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("bias", { value = "bias", rows = "technique" })
x:table("samples", { value = "samples", rows = "technique" })

return x
