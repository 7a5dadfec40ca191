-- NOVOBUS (Novotron ND21, manual 1/96, chapters 8 to 10) for Wireshark and tshark, from 4.0 on.
--
-- It reads what `drivebench trace --format pcapng` writes, or any capture of link type 250 (LINKTYPE_RTAC_SERIAL) with
-- one byte a packet and one interface a link, named `98->97`, `master->99`, `0->master`.
--
--     drivebench dissector > novobus.lua
--     tshark -X lua_script:novobus.lua -d rtacser.data,novobus -r ring.pcapng
--     wireshark -X lua_script:novobus.lua ring.pcapng       (and "Decode As...": RTAC Serial, NOVOBUS)
--
-- A telegram spans many packets: what is known of each link is kept while the capture is read in order, and what a byte was
-- is kept by its packet. A byte is shown as the receiver of its link reads it.

local novobus = Proto("novobus", "NOVOBUS")

local ROLES = {
    synco = "SYNCO (9.2)", pause = "PAUSE (9.2)", sync = "sync byte (9.2)", address = "address byte (9.3)",
    ["process-data"] = "process data (9.4)", command = "command (9.5)", parameter = "parameter (10)", data = "data (10.1)",
    check = "checking byte (9.6)", net = "net byte (9.5)", ["error-zero"] = "zero of the error mode (9.7)",
    ["error-address"] = "number spelled out (9.7)", ["check-sequence"] = "check sequence (9.8)",
    foreign = "no telegram (9.7)", lost = "nothing arrived",
}
local COMMANDS = {
    [0xC0] = "ReadByte", [0xC1] = "ReadWord", [0xC7] = "ReadLong", [0x82] = "WriteByte", [0x63] = "WriteWord",
    [0xA4] = "And", [0xA5] = "Or", [0xC8] = "WriteIO", [0xDD] = "ResetH8",
}
-- What stands behind the command byte (10.1 to 10.5). L, H: address; P: address in page FF; D: data; C: code; K: checking
-- byte; a number: that byte. In answers E: the byte that was received; D: data of the cell; K: checking byte.
local LAYOUTS = {
    [0xC0] = { { "L", "H", "K" }, { "E", "D", "K" } },
    [0xC1] = { { "L", "H", 0x3F, "K" }, { "E", "D", "D", "K" } },
    [0xC7] = { { "L", "H", 0x31, 0x32, "K" }, { "E", "D", "D", "D", "D" } },
    [0x82] = { { "D", "L", "H", "K" }, { "E", "E", "E", "K" } },
    [0x63] = { { "D", "D", "L", "H", "K" }, { "E", "E", "E", "E", "K" } },
    [0xA4] = { { "D", "P", "K" }, { "E", "E", "K" } },
    [0xA5] = { { "D", "P", "K" }, { "E", "E", "K" } },
    [0xC8] = { { "C", "K" }, { "E", "K" } },
    [0xDD] = { { 0x21, "K" }, { "E", "K" } },
}
local SEQUENCE = { 0xFF, 0x44, 0x72, 0x4C, 0x41 }
local STATUS = { [0x02] = "ok", [0x05] = "dropped", [0x07] = "framing", [0x08] = "parity", [0x09] = "break", [0x0A] = "overrun" }

local F = {
    byte = ProtoField.uint8("novobus.byte", "Byte", base.HEX),
    role = ProtoField.string("novobus.role", "Role"),
    status = ProtoField.string("novobus.status", "Line status"),
    link = ProtoField.string("novobus.link", "Link"),
    number = ProtoField.uint32("novobus.number", "Byte that arrived on the link", base.DEC),
    sync_next = ProtoField.bool("novobus.sync.next", "N: next drive", 8, nil, 0x40),
    sync_short = ProtoField.bool("novobus.sync.short", "S: short address", 8, nil, 0x20),
    sync_length = ProtoField.uint8("novobus.sync.length", "T: net bytes", base.DEC, nil, 0x0E),
    sync_data = ProtoField.bool("novobus.sync.process_data", "D: process data", 8, nil, 0x01),
    address = ProtoField.uint8("novobus.address", "Address byte", base.HEX),
    drive = ProtoField.uint8("novobus.drive", "Drive", base.DEC),
    answer = ProtoField.bool("novobus.answer", "Answer"),
    command = ProtoField.uint8("novobus.command", "Command", base.HEX, COMMANDS),
    cell = ProtoField.uint16("novobus.cell", "Cell", base.HEX),
    data = ProtoField.uint8("novobus.data", "Data", base.HEX),
    process_data = ProtoField.uint8("novobus.process_data", "Process data", base.HEX),
    check = ProtoField.uint8("novobus.check", "Checking byte", base.HEX),
    check_good = ProtoField.bool("novobus.check.good", "Checking byte fits"),
    error_mode = ProtoField.bool("novobus.error_mode", "Receiver in the error mode"),
    error_zeros = ProtoField.uint32("novobus.error.zeros", "Zeros in a row", base.DEC),
    error_drive = ProtoField.uint8("novobus.error.drive", "Number spelled out", base.DEC),
    sequence = ProtoField.uint8("novobus.check_sequence", "Byte of the check sequence", base.DEC),
    telegram = ProtoField.string("novobus.telegram", "Telegram"),
}
novobus.fields = {}
for _, field in pairs(F) do table.insert(novobus.fields, field) end

local bad_status = ProtoExpert.new("novobus.bad_status", "Damaged on the line", expert.group.CHECKSUM, expert.severity.ERROR)
local bad_check = ProtoExpert.new("novobus.bad_check", "The checking byte does not fit (9.6)", expert.group.CHECKSUM,
    expert.severity.WARN)
novobus.experts = { bad_status, bad_check }

local interface_name = Field.new("frame.interface_name")
local event_type = Field.new("rtacser.eventtype")

-- What is known of each link, by its name, and of each packet, by its number.
local links, seen = {}, {}

function novobus.init()
    links, seen = {}, {}
end

local function ends(name)
    local from, to = name:gsub("^2:", ""):match("^(%w+)%->(%w+)$")
    return tonumber(from), tonumber(to)
end

local function fresh(link)
    link.target, link.address_next, link.net, link.process, link.begun = nil, false, 0, 0, {}
    link.foreign, link.zeros, link.upstream, link.spelling, link.matched = false, 0, link.to == nil, false, 0
end

local function new_link(name)
    local link = { count = 0 }
    link.from, link.to = ends(name)
    -- What an address byte on this link falls short of the drive's number (9.3).
    link.behind = link.from or ((link.to or 0) + 1)
    fresh(link)
    return link
end

local function with_target(link, role)
    local answer = link.target ~= nil and link.from ~= nil and link.from <= link.target
    return { role = role, drive = link.target, answer = answer }
end

local function sum(bytes, sign)
    local total = 0
    for _, byte in ipairs(bytes) do total = total + byte end
    total = (sign * total) % 256
    if total == 0 then return 1 end
    return total
end

-- The address in a begun command, once it is whole.
local function cell(layout, bytes, answer)
    local low, high
    for place = 2, #bytes do
        local field = layout[1][place - 1]
        if not answer or layout[2][place - 1] == "E" then
            if field == "L" then low = bytes[place] end
            if field == "P" then low, high = bytes[place], 0xFF end
            if field == "H" then high = bytes[place] end
        end
    end
    if low and high then return high * 256 + low end
    return nil
end

-- A byte of the parameter channel (9.5); nil where the drive that is meant refuses it.
local function parameter(link, byte)
    if link.target == nil then return { role = "net" } end
    local looked_at = link.to ~= nil and link.to == link.target
    local what = with_target(link, "net")
    local begun = link.begun[link.target]
    if begun == nil then
        if LAYOUTS[byte] == nil then
            if looked_at then return nil end
            return what
        end
        link.begun[link.target] = { byte }
        what.role, what.command = "command", byte
        return what
    end
    local layout = LAYOUTS[begun[1]]
    local place = #begun
    local before = sum(begun, what.answer and -1 or 1)
    table.insert(begun, byte)
    what.command = begun[1]
    what.cell = cell(layout, begun, what.answer)
    local kind = layout[what.answer and 2 or 1][place]
    if kind == "K" then
        what.role, what.good = "check", before == byte
    elseif kind == "D" and what.answer then
        what.role = "data"
    elseif type(kind) == "number" and kind ~= byte and looked_at then
        return nil
    else
        what.role = "parameter"
    end
    if #begun == 1 + #layout[1] then link.begun[link.target] = nil end
    if looked_at and what.good == false then return nil end
    return what
end

-- A good byte in normal mode; nil where the receiver goes into the error mode for it (9.7).
local function telegram(link, byte)
    if link.address_next then
        link.address_next = false
        link.target = (byte + link.behind) % 256
        return with_target(link, "address")
    end
    if link.net > 0 then
        link.net = link.net - 1
        if link.process > 0 then
            link.process = link.process - 1
            return with_target(link, "process-data")
        end
        return parameter(link, byte)
    end
    if byte == 0x80 then return { role = "synco" } end
    if byte == 0x81 then return { role = "pause" } end
    local short, next_drive, with_data = bit.band(byte, 0x20) ~= 0, bit.band(byte, 0x40) ~= 0, bit.band(byte, 1) ~= 0
    local length = bit.rshift(bit.band(byte, 0x0E), 1)
    if bit.band(byte, 0x90) ~= 0x80 or (next_drive and not short) or (with_data and length < 2) then return nil end
    link.net, link.process = length, with_data and 2 or 0
    if not short then
        link.address_next = true
        return { role = "sync" }
    end
    if next_drive and link.target then link.target = (link.target + 1) % 256 end
    return with_target(link, "sync")
end

local function watch(link, byte, good)
    if not good then
        link.matched = 0
        return nil
    end
    if byte == SEQUENCE[link.matched + 1] then
        link.matched = link.matched + 1
    else
        link.matched = byte == SEQUENCE[1] and 1 or 0
    end
    if link.matched == 0 then return nil end
    return link.matched
end

-- A byte that the receiver hears in the error mode (9.7, 9.8).
local function error_mode(link, byte, good)
    link.zeros = (good and byte == 0) and link.zeros + 1 or 0
    if link.zeros >= 8 then link.upstream = true end
    if link.zeros >= 7 then link.spelling = true end
    local what = { role = "foreign", error_mode = true, zeros = link.zeros }
    if link.upstream then
        local place = watch(link, byte, good)
        if place then
            if place == #SEQUENCE then fresh(link) end
            return { role = "check-sequence", error_mode = true, sequence = place }
        end
    end
    if not good then return what end
    if byte == 0 then
        what.role = "error-zero"
    elseif link.spelling and link.from ~= nil then
        what.role, what.number = "error-address", byte
    end
    return what
end

local function see(link, byte, good)
    if byte == nil then return { role = "lost" } end
    if not link.foreign then
        local what = good and telegram(link, byte) or nil
        if what then return what end
        link.foreign = true
    end
    return error_mode(link, byte, good)
end

-- The bytes of a telegram as they come; whole with the last of them.
local function collect(link, what, byte)
    if what.role == "sync" then link.telegram = {} end
    local inside = what.error_mode == nil and what.role ~= "synco" and what.role ~= "pause" and what.role ~= "lost"
    if not inside or link.telegram == nil then
        link.telegram = nil
        return
    end
    table.insert(link.telegram, string.format("%02X", byte))
    if link.net == 0 and not link.address_next then
        what.telegram = table.concat(link.telegram, " ")
        link.telegram = nil
    end
end

local function words(what, byte)
    local text = ROLES[what.role] or what.role
    if what.command then text = (what.answer and "answer to " or "") .. COMMANDS[what.command] .. ", " .. text end
    if what.cell then text = text .. string.format(" of %04X", what.cell) end
    if what.drive then text = text .. " for drive " .. what.drive end
    if what.number then text = text .. ": " .. what.number end
    if byte then text = string.format("%02X  ", byte) .. text end
    return text
end

function novobus.dissector(buffer, pinfo, tree)
    local name = tostring(interface_name() or "")
    local event = event_type() and event_type().value or 0x02
    local length = buffer:len()
    if length > 1 then return 0 end
    local byte = length == 1 and buffer(0, 1):uint() or nil
    local status = STATUS[event] or "ok"
    local what = seen[pinfo.number]
    if what == nil then
        local link = links[name] or new_link(name)
        links[name] = link
        link.count = link.count + 1
        what = see(link, byte, status == "ok")
        what.count = link.count
        collect(link, what, byte)
        seen[pinfo.number] = what
    end
    pinfo.cols.protocol = "NOVOBUS"
    pinfo.cols.info = name .. "  " .. words(what, byte) .. (status ~= "ok" and "  [" .. status .. "]" or "")
    local range = length == 1 and buffer(0, 1) or buffer()
    local root = tree:add(novobus, range, "NOVOBUS, " .. words(what, byte))
    local add = function(field, value) return root:add(field, range, value):set_generated() end
    if byte then root:add(F.byte, range) end
    root:add(F.role, range, what.role)
    add(F.link, name)
    add(F.number, what.count)
    local item = add(F.status, status)
    if status ~= "ok" then item:add_proto_expert_info(bad_status, "Damaged on the line: " .. status) end
    if what.role == "sync" then
        for _, field in ipairs({ F.sync_next, F.sync_short, F.sync_length, F.sync_data }) do root:add(field, range) end
    end
    if what.role == "address" then root:add(F.address, range) end
    if what.drive then add(F.drive, what.drive) end
    if what.drive then add(F.answer, what.answer) end
    if what.command then add(F.command, what.command) end
    if what.cell then add(F.cell, what.cell) end
    if what.role == "data" then root:add(F.data, range) end
    if what.role == "process-data" then root:add(F.process_data, range) end
    if what.role == "check" then
        root:add(F.check, range)
        item = add(F.check_good, what.good)
        if not what.good then item:add_proto_expert_info(bad_check) end
    end
    if what.error_mode then add(F.error_mode, true) end
    if what.zeros and what.zeros > 0 then add(F.error_zeros, what.zeros) end
    if what.number then add(F.error_drive, what.number) end
    if what.sequence then add(F.sequence, what.sequence) end
    if what.telegram then add(F.telegram, what.telegram) end
    return length
end

DissectorTable.get("rtacser.data"):add_for_decode_as(novobus)
