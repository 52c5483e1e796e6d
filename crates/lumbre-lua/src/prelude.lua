-- Runs once in every new state, before any script, and removes all globals that scripts may not use.
--
-- A debug hook counts instructions and interrupts scripts that exceed their time limit. It is not called inside the C
-- functions of Lua's libraries, nor inside finalizers and error handlers, so functions that could run there for a long
-- time are guarded here.

local native = ...

local raw_pcall, raw_pairs, raw_setmetatable = pcall, pairs, setmetatable
local error, getmetatable, next, rawget, tonumber, tostring, type =
  error, getmetatable, next, rawget, tonumber, tostring, type
local concat, pack, sort = table.concat, table.pack, table.sort
local find, gsub = string.find, string.gsub
local within_limits, plain_table, quick_pattern = native.within_limits, native.plain_table, native.quick_pattern

local MAX_ELEMENTS = 10000000 -- largest number of elements that one call may visit
local MAX_STRING = 1 << 28 -- largest result of string.rep in bytes

local allowed = {}
for _, name in next, { "_G", "_VERSION", "assert", "error", "getmetatable", "ipairs", "math", "next", "pairs", "pcall",
  "print", "rawequal", "rawget", "rawlen", "rawset", "require", "select", "setmetatable", "string", "table",
  "tonumber", "tostring", "type", "utf8", "xpcall" } do
  allowed[name] = true
end
for name in next, _G do
  if not allowed[name] then _G[name] = nil end
end
string.dump, math.random, math.randomseed = nil, nil, nil

-- Raises the error of a passed time limit again, outside the protected call, so that a script cannot catch it.
local function check_limits(...)
  within_limits()
  return ...
end

function pcall(f, ...)
  return check_limits(raw_pcall(f, ...))
end

-- Calls the handler after the failed call has returned. Lua would call it inside the failed call, where no limit applies.
local function call_handler(handler, ok, ...)
  if ok then return ok, ... end
  return ok, handler(...)
end

function xpcall(f, handler, ...)
  return call_handler(handler, check_limits(raw_pcall(f, ...)))
end

-- Finalizers would run where no limit applies, so they are refused. `__close` metamethods are removed when a limit has
-- passed; for that, every metatable is recorded in a weak table.
local metatables = raw_setmetatable({}, { __mode = "k" })
native.metatables = metatables

function setmetatable(t, meta)
  if type(meta) == "table" and rawget(meta, "__gc") ~= nil then
    error("finalizers (__gc) are not available in scripts", 2)
  end
  if type(meta) == "table" then metatables[meta] = true end
  return raw_setmetatable(t, meta)
end

-- Orders keys. Lua's own order of named keys changes from run to run; a sweep built in a loop must not.
local function before(a, b)
  local ta, tb = type(a), type(b)
  if ta ~= tb then return ta < tb end
  if ta == "number" or ta == "string" then return a < b end
  return false
end

function pairs(t)
  local meta = getmetatable(t)
  if type(t) ~= "table" or (type(meta) == "table" and rawget(meta, "__pairs") ~= nil) then return raw_pairs(t) end
  local keys, n = {}, 0
  for key in next, t do
    n = n + 1
    keys[n] = key
  end
  sort(keys, before)
  local i = 0
  return function()
    while i < n do
      i = i + 1
      local value = rawget(t, keys[i])
      if value ~= nil then return keys[i], value end
    end
  end, t, nil
end

function print(...)
  local parts = pack(...)
  for i = 1, parts.n do parts[i] = tostring(parts[i]) end
  native.log(concat(parts, "\t"))
end

-- Adds a check of the arguments to a library function that loops in C as often as its arguments demand.
local function guard(library, name, check)
  local raw = library[name]
  library[name] = function(...)
    check(...)
    return raw(...)
  end
end

local function check_range(from, to)
  from, to = tonumber(from), tonumber(to)
  if from and to and to - from > MAX_ELEMENTS then
    error("this would visit more than " .. MAX_ELEMENTS .. " elements", 4)
  end
end

guard(table, "insert", plain_table)
guard(table, "remove", plain_table)
guard(table, "sort", plain_table)
guard(table, "unpack", function(t, from, to) plain_table(t) check_range(from or 1, to) end)
guard(table, "concat", function(t, _, from, to) plain_table(t) check_range(from or 1, to) end)
guard(table, "move", function(_, from, to) check_range(from, to) end)
guard(string, "rep", function(text, n, separator)
  local length = #tostring(text) + #tostring(separator or "")
  n = tonumber(n)
  if n and n > 0 and (n > MAX_STRING or n * length > MAX_STRING) then
    error("string.rep would make more than " .. (MAX_STRING >> 20) .. " MiB", 3)
  end
end)
guard(string, "format", function(text)
  if type(text) == "string" and find(gsub(text, "%%%%", ""), "%%[-0-9]*p") then
    error("string.format(\"%p\") would write an address, which differs in every process", 3)
  end
end)
for _, name in next, { "match", "gmatch", "gsub" } do
  guard(string, name, function(text, pattern) quick_pattern(text, pattern, false) end)
end
guard(string, "find", function(text, pattern, _, plain) quick_pattern(text, pattern, plain) end)

getmetatable("").__metatable = false
