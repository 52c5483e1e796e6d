-- scripts/recipes/other_renderers.lua: LuxCore and Cycles beside the techniques of Lumbre.

local x = experiment("other_renderers", { seed = 22 })

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

x:axis("technique", { "nee", "bdpt", path, bidir, cycles })
x:axis("python", { "python3" })
x:axis("size", { 48 })
x:axis("samples", { 64 })

x:render(function(p)
  local own = p.technique == "nee" or p.technique == "bdpt"
  return {
    scene = "scenes/two_spheres.lua",
    integrator = p.technique,
    -- The interpreter that has the packages.
    python = not own and p.python or nil,
    resolution = { p.size, p.size },
    max_depth = 5,
  }
end)

x:reference {
  from = function() return { integrator = "bdpt" } end,
  stop = function(p) return stop.samples(64 * p.samples) end,
}

x:measure { every = "5s", rmse = metric.rmse(), bias = metric.bias(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(p.samples) end)

x:figure("convergence", { x = "render_s", y = { "rmse" }, by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
x:table("bias", { value = "bias", rows = "technique" })
x:table("seconds", { value = "render_s", rows = "technique" })

return x
