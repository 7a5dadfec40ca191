-- UNITEK DS and BAMOCAR on CAN (manual "DS CAN-BUS", chapters 4 and 5) for Wireshark and tshark, from 4.0 on.
--
-- It reads frames of CAN from any capture: what `drivebench trace --format pcapng` writes, link type 227 (SocketCAN), candump.
--
--     drivebench dissector --bus unitek > unitek.lua
--     tshark -X lua_script:unitek.lua -r drive.pcapng
--     wireshark -X lua_script:unitek.lua drive.pcapng
--
-- Drive n receives on 200+n and sends on 180+n (3.1). Other identifiers are a preference: pairs of what a drive receives on and sends on,
-- in hexadecimal digits, as in -o unitek.pairs:"210:190 100:120".
--
-- A frame of a drive has no mark of its own: it is a reply where its register was asked for, one of a cycle where a cycle of it runs, and
-- else an event. What was asked is kept while the capture is read in order, and what a frame is, by its packet.

local unitek = Proto("unitek", "UNITEK DS")

-- Name, bits, whether it is signed, unit: one row a register.
local REGISTERS = {
@REGISTERS@
}
local BITS = {
@BITS@
}

local NAMES = {}
for number, row in pairs(REGISTERS) do NAMES[number] = row[1] end

local F = {
    kind = ProtoField.string("unitek.kind", "Kind"),
    drive = ProtoField.string("unitek.drive", "Drive"),
    register = ProtoField.uint8("unitek.register", "Register", base.HEX, NAMES),
    raw = ProtoField.uint32("unitek.raw", "Contents", base.HEX),
    value = ProtoField.string("unitek.value", "Value"),
    interval = ProtoField.uint8("unitek.interval", "Interval in ms", base.DEC),
    stuff = ProtoField.uint8("unitek.stuff", "Stuff byte, no meaning", base.HEX),
}
unitek.fields = {}
for _, field in pairs(F) do table.insert(unitek.fields, field) end

local odd_length = ProtoExpert.new("unitek.odd_length", "Length that the manual does not print (4.1)", expert.group.PROTOCOL,
    expert.severity.WARN)
unitek.experts = { odd_length }

unitek.prefs.pairs = Pref.string("Further identifiers", "", "What a drive receives on and sends on: 210:190 100:120")

local can_id = Field.new("can.id")

-- Drives by the identifier on which they receive, and on which they send.
local hears, sends = {}, {}
-- What is known of each drive, and of each packet.
local drives, seen = {}, {}

local function identify()
    local known = DissectorTable.get("can.id")
    for id in pairs(hears) do known:remove(id, unitek) end
    for id in pairs(sends) do known:remove(id, unitek) end
    hears, sends = {}, {}
    for node = 1, 127 do
        hears[0x200 + node] = tostring(node)
        sends[0x180 + node] = tostring(node)
    end
    for rx, tx in unitek.prefs.pairs:gmatch("(%x+):(%x+)") do
        hears[tonumber(rx, 16)] = rx
        sends[tonumber(tx, 16)] = rx
    end
    for id in pairs(hears) do known:add(id, unitek) end
    for id in pairs(sends) do known:add(id, unitek) end
end

function unitek.init()
    drives, seen = {}, {}
end

function unitek.prefs_changed()
    identify()
end

local function drive(name)
    drives[name] = drives[name] or { asked = {}, cycles = {} }
    return drives[name]
end

-- The number in a register, from 16 or 32 bits: extended as the drive does it (App 1).
local function number(row, raw, bits)
    if row[2] == 16 then
        raw, bits = raw % 0x10000, 16
    end
    if row[3] and raw >= 2 ^ (bits - 1) then return raw - 2 ^ bits end
    return raw
end

local function value(register, raw, bits)
    local row = REGISTERS[register]
    local unit, own = row[4], number(row, raw, bits)
    local function scaled(form, scale) return string.format(form, own * scale) end
    if unit == "speed" then return scaled("%.1f%%", 100 / 32767) end
    if unit == "torque" then return scaled("%.1f%%", 150 / 32767) end
    if unit == "rpm" then return scaled("%d rpm", 1) end
    if unit == "ms" then return scaled("%d ms", 1) end
    if unit == "ramp" then return string.format("%d ms", raw % 0x10000) end
    if unit == "turns" then return scaled("%.3f turns", 1 / 65536) end
    if unit == "deciampere" then return scaled("%.1f A", 1 / 10) end
    local names = BITS[unit]
    if not names then return string.format("%d", own) end
    local set = {}
    for bit = 0, 31 do
        if math.floor(raw / 2 ^ bit) % 2 == 1 then table.insert(set, names[bit] or ("bit " .. bit)) end
    end
    return table.concat(set, " ")
end

-- What a frame to a drive is (chapters 4 and 5); a drive reads 4 bytes as 3 and 6 to 8 as 5.
local function asked(name, tvb)
    local length = tvb:len()
    local found = { drive = name, odd = length ~= 3 and length ~= 5 }
    if length < 3 then
        found.kind = "ignored"
        return found
    end
    local own, register = drive(name), tvb(0, 1):uint()
    if register ~= 0x3D then
        found.kind, found.register, found.bits = "write", register, length >= 5 and 32 or 16
        return found
    end
    register = tvb(1, 1):uint()
    local interval = tvb(2, 1):uint()
    found.register, found.interval = register, interval
    if interval == 0 then
        found.kind = "request"
        own.asked[register] = (own.asked[register] or 0) + 1
    elseif interval == 0xFF then
        found.kind = "stop"
        own.cycles[register] = nil
    else
        found.kind = "request cycle"
        own.cycles[register] = interval
    end
    return found
end

-- What a frame of a drive is.
local function answered(name, tvb)
    local length = tvb:len()
    local found = { drive = name, odd = length ~= 4 and length ~= 6 }
    if length < 3 then
        found.kind = "unknown"
        return found
    end
    local own, register = drive(name), tvb(0, 1):uint()
    found.register, found.bits = register, length >= 5 and 32 or 16
    if (own.asked[register] or 0) > 0 then
        own.asked[register] = own.asked[register] - 1
        found.kind = "reply"
    elseif own.cycles[register] then
        found.kind = "cycle"
    else
        found.kind = "event"
    end
    return found
end

local function summary(found, text)
    local name = found.register and string.format("%02X %s", found.register, NAMES[found.register]) or ""
    local parts = { "drive " .. found.drive, found.kind, name }
    if found.interval and found.interval > 0 and found.interval < 255 then table.insert(parts, found.interval .. " ms") end
    if text then table.insert(parts, "= " .. text) end
    return table.concat(parts, " ")
end

function unitek.dissector(tvb, pinfo, tree)
    local id = can_id()
    if not id then return 0 end
    local from, to = sends[id.value], hears[id.value]
    if not seen[pinfo.number] then seen[pinfo.number] = from and answered(from, tvb) or asked(to, tvb) end
    local found = seen[pinfo.number]
    local own = tree:add(unitek, tvb())
    own:add(F.kind, found.kind):set_generated()
    own:add(F.drive, found.drive):set_generated()
    local text
    if found.interval then
        own:add(F.register, tvb(1, 1))
        own:add(F.interval, tvb(2, 1))
    elseif found.register then
        local bytes = found.bits / 8
        local raw = tvb(1, bytes):le_uint()
        text = value(found.register, raw, found.bits)
        own:add(F.register, tvb(0, 1))
        own:add_le(F.raw, tvb(1, bytes))
        own:add(F.value, tvb(1, bytes), text)
        if from and tvb:len() > bytes + 1 then own:add(F.stuff, tvb(bytes + 1, 1)) end
    end
    if found.odd then
        own:add_proto_expert_info(odd_length, string.format("%d data bytes: 3 or 5 to a drive, 4 or 6 of one (4.1)", tvb:len()))
    end
    pinfo.cols.protocol = "UNITEK"
    pinfo.cols.info = summary(found, text)
    return tvb:len()
end

identify()
