-- own_technique.lua: how many vertices should be connected to lights?
--
--     cargo run --release -- run own_technique.lua      renders, measures, prints the table
--     cargo run --release -- report out/latest          figures, tables with significance, a page

local x = experiment("own_technique", { seed = 1, repeats = 3 })

-- Pass other values on the command line: `run own_technique.lua time=10s`.
x:axis("technique", { "own_technique", "nee" })
x:axis("connect", { 0.25, 0.5, 1 })
x:axis("size", { 64 })
x:axis("time", { "2s" })

-- `nee` has no such parameter, so it is one cell.
x:skip("no such parameter", function(p) return p.technique == "nee" and p.connect ~= 1 end)

x:render(function(p)
  return {
    scene = "scene.lua",
    integrator = p.technique,
    connect = p.technique == "own_technique" and p.connect or nil,
    max_depth = 5,
    resolution = { p.size, p.size },
  }
end)

x:reference {
  from = function() return { integrator = "nee" } end,
  stop = stop.samples(256),
}

x:measure { every = "500ms", relmse = metric.relmse() }
x:stop(function(p) return stop.time(p.time) end)
x:figure("convergence", { x = "render_s", y = { "relmse" }, by = "technique", facet = { "connect" } })
x:table("errors", { value = "relmse", rows = "technique", cols = "connect" })

return x
