-- NORDAC vector on PROFIBUS DP (manual "PROFIBUS DP for NORDAC vector", chapters 3 to 5; EN 50170) for Wireshark and tshark, from 4.0 on.
--
-- It reads what `drivebench trace --format pcapng` writes, or any capture of link type 250 (LINKTYPE_RTAC_SERIAL) with whole telegrams in its
-- packets: one a packet where interfaces are named by their station, `master` or `slave 8`, and any number where they are not.
--
--     drivebench dissector --bus nordac > nordac.lua
--     tshark -X lua_script:nordac.lua -d rtacser.data,nordac -r drive.pcapng
--     wireshark -X lua_script:nordac.lua drive.pcapng       (and "Decode As...": RTAC Serial, NORDAC)
--
-- A reply does not name its service, and PPO1 and PPO4 have the same length. So the last request and the last Chk_Cfg of each slave are kept
-- while the capture is read in order, and what a telegram is, by its packet. Without a Chk_Cfg the preference "PPO type" decides, as in
-- -o nordac.ppo:4; without it 12 bytes are PPO1 where they begin with a parameter channel that can be one, and else PPO4.

local nordac = Proto("nordac", "NORDAC on PROFIBUS DP")

-- Services by the SAP at the slave.
local SERVICES = {
@SERVICES@
}
-- Functions of a request, by bits 3 to 0 of FC.
local FUNCTIONS = {
@FUNCTIONS@
}
-- The status of a reply, by bits 3 to 0 of FC.
local STATUS = {
@STATUS@
}
-- Bits of a diagnosis: byte, bit, name.
local DIAGNOSIS = {
@DIAGNOSIS@
}
-- Bits of Set_Prm and of Global_Control: mask, name.
local PRM = {
@PRM@
}
local CONTROL = {
@CONTROL@
}
local STW = {
@STW@
}
local ZSW = {
@ZSW@
}
-- States: short name, bits 6 and 3 to 0 of ZSW, and where two share them whether bit 5 is 0.
local STATES = {
@STATES@
}
-- PPO types: number, configuration, bytes, whether there is a parameter channel.
local PPO = {
@PPO@
}
-- Tasks of the parameter channel: name, whether it changes a value.
local TASKS = {
@TASKS@
}
local ERRORS = {
@ERRORS@
}
-- Parameters: name, whether the value is a double word, whether it has a sign, unit, units of some elements. A unit: step, places, name.
local PARAMETERS = {
@PARAMETERS@
}
-- Why bytes are no telegram.
local REASONS = {
@REASONS@
}
-- Events of damaged telegrams.
local LINE_ERRORS = {
@LINE_ERRORS@
}
local LOST = 0x05

local PARAMETER_NAMES = {}
for number, row in pairs(PARAMETERS) do PARAMETER_NAMES[number] = row[1] end
local TASK_NAMES = {}
for number, row in pairs(TASKS) do TASK_NAMES[number] = row[1] end

local F = {
    sender = ProtoField.string("nordac.sender", "Sender"),
    service = ProtoField.string("nordac.service", "Service"),
    meaning = ProtoField.string("nordac.meaning", "Meaning"),
    status = ProtoField.string("nordac.status", "Line status"),
    da = ProtoField.uint8("nordac.da", "Destination (DA)", base.DEC, nil, 0x7F),
    sa = ProtoField.uint8("nordac.sa", "Source (SA)", base.DEC, nil, 0x7F),
    fc = ProtoField.uint8("nordac.fc", "Frame control (FC)", base.HEX),
    fcb = ProtoField.bool("nordac.fcb", "FCB", 8, nil, 0x20),
    fcv = ProtoField.bool("nordac.fcv", "FCV", 8, nil, 0x10),
    function_name = ProtoField.string("nordac.function", "Function"),
    reply = ProtoField.string("nordac.reply", "Reply"),
    dsap = ProtoField.uint8("nordac.dsap", "DSAP", base.DEC),
    ssap = ProtoField.uint8("nordac.ssap", "SSAP", base.DEC),
    data = ProtoField.bytes("nordac.data", "Data"),
    fcs = ProtoField.uint8("nordac.fcs", "FCS", base.HEX),
    fcs_good = ProtoField.bool("nordac.fcs.good", "FCS fits"),
    watchdog = ProtoField.uint32("nordac.prm.watchdog", "Watchdog in ms", base.DEC),
    min_tsdr = ProtoField.uint8("nordac.prm.min_tsdr", "min T_SDR in bits", base.DEC),
    ident = ProtoField.uint16("nordac.ident", "Ident number", base.HEX),
    group = ProtoField.uint8("nordac.group", "Groups", base.HEX),
    diagnosis = ProtoField.string("nordac.diagnosis", "Diagnosis"),
    master = ProtoField.uint8("nordac.diagnosis.master", "Master", base.DEC, { [255] = "none" }),
    ppo = ProtoField.uint8("nordac.ppo", "PPO type", base.DEC),
    stw = ProtoField.uint16("nordac.stw", "STW", base.HEX),
    zsw = ProtoField.uint16("nordac.zsw", "ZSW", base.HEX),
    hsw = ProtoField.double("nordac.hsw", "HSW in %"),
    hiw = ProtoField.double("nordac.hiw", "HIW in %"),
    pzd3 = ProtoField.uint16("nordac.pzd3", "PZD3", base.HEX),
    pzd4 = ProtoField.uint16("nordac.pzd4", "PZD4", base.HEX),
    pkw = ProtoField.bytes("nordac.pkw", "Parameter channel (PKW)"),
    task = ProtoField.uint16("nordac.pkw.task", "Task", base.DEC, TASK_NAMES, 0xF000),
    answer = ProtoField.uint16("nordac.pkw.answer", "Answer", base.DEC, nil, 0xF000),
    parameter = ProtoField.uint16("nordac.pkw.parameter", "Parameter", base.DEC, PARAMETER_NAMES, 0x07FF),
    index = ProtoField.uint16("nordac.pkw.index", "IND", base.HEX),
    value = ProtoField.string("nordac.pkw.value", "Value"),
    error = ProtoField.uint16("nordac.pkw.error", "Error", base.DEC, ERRORS),
    request_in = ProtoField.framenum("nordac.request_in", "Request in", base.NONE, frametype.REQUEST),
}
local FIELDS = {}
for _, field in pairs(F) do table.insert(FIELDS, field) end

-- A field a bit: nordac.stw.enable, nordac.zsw.fault; bits without a name are nordac.stw.bit8.
local function bit_fields(word, names)
    local fields = {}
    for number = 0, 15 do
        local name = names[number]:lower():gsub("[^%w]+", "_")
        if tonumber(name) then name = "bit" .. name end
        local field = ProtoField.bool("nordac." .. word .. "." .. name, number .. " " .. names[number], 16, nil, 2 ^ number)
        table.insert(fields, field)
        table.insert(FIELDS, field)
    end
    return fields
end
local STW_FIELDS, ZSW_FIELDS = bit_fields("stw", STW), bit_fields("zsw", ZSW)
nordac.fields = FIELDS

local bad_status = ProtoExpert.new("nordac.bad_status", "Damaged on the line", expert.group.CHECKSUM, expert.severity.ERROR)
local bad_fcs = ProtoExpert.new("nordac.bad_fcs", "FCS does not fit", expert.group.CHECKSUM, expert.severity.ERROR)
local no_telegram = ProtoExpert.new("nordac.no_telegram", "No telegram", expert.group.MALFORMED, expert.severity.ERROR)
local bad_length = ProtoExpert.new("nordac.bad_length", "Length that the service does not have", expert.group.PROTOCOL, expert.severity.WARN)
local repeated = ProtoExpert.new("nordac.repeated", "Repeated request", expert.group.SEQUENCE, expert.severity.NOTE)
local refused = ProtoExpert.new("nordac.refused", "Refused", expert.group.RESPONSE_CODE, expert.severity.WARN)
nordac.experts = { bad_status, bad_fcs, no_telegram, bad_length, repeated, refused }

nordac.prefs.ppo = Pref.uint("PPO type", 0, "Of slaves without a Chk_Cfg in the capture: 1 to 4; 0 takes what fits")

local interface_name = Field.new("frame.interface_name")
local event_type = Field.new("rtacser.eventtype")
local packet_comment = Field.new("frame.comment")

-- The last request: slave, service, packet. Of each slave: its PPO type, its last counted request. What a telegram is, by its packet.
local asked, types, records, seen = nil, {}, {}, {}

function nordac.init()
    asked, types, records, seen = nil, {}, {}, {}
end

local function has(value, bit) return math.floor(value / 2 ^ bit) % 2 == 1 end

local function hex(bytes, from, to)
    local digits = {}
    for place = from or 1, to or #bytes do table.insert(digits, string.format("%02X", bytes[place])) end
    return table.concat(digits, " ")
end

local function word(bytes, place) return bytes[place] * 256 + bytes[place + 1] end

local function signed(value, bits)
    if value >= 2 ^ (bits - 1) then return value - 2 ^ bits end
    return value
end

-- DA to the end, from `begin` on, with `length` bytes behind FC (EN 1): the telegram, or nil, the reason and its place.
local function body(bytes, begin, length)
    local function at(index) return bytes[begin + index] end
    local function extended(index) return at(index) ~= nil and at(index) >= 0x80 end
    local saps = (extended(0) and 1 or 0) + (extended(1) and 1 or 0)
    if extended(0) and length == 0 then return nil, REASONS.sap_missing, begin end
    if at(1) and at(1) % 0x80 == 127 then return nil, REASONS.source, begin + 1 end
    if saps > length then return nil, REASONS.sap_missing, begin + 1 end
    if extended(2) then return nil, REASONS.control, begin + 2 end
    for index = 3, 2 + saps do
        if at(index) and at(index) > 63 then return nil, REASONS.sap, begin + index end
    end
    local finish = 3 + length
    if at(finish) then
        local sum = 0
        for index = 0, finish - 1 do sum = sum + at(index) end
        if sum % 256 ~= at(finish) then return nil, REASONS.check_sum, begin + finish, true end
    end
    if at(finish + 1) and at(finish + 1) ~= 0x16 then return nil, REASONS.finish, begin + finish + 1 end
    if not at(finish + 1) then return nil, "it is not complete", #bytes end
    local own = { kind = "pdu", begin = begin, da = at(0) % 0x80, sa = at(1) % 0x80, fc = at(2), fcs = begin + finish }
    local place = 3
    if extended(0) then own.dsap, own.dsap_at, place = at(place), begin + place, place + 1 end
    if extended(1) then own.ssap, own.ssap_at, place = at(place), begin + place, place + 1 end
    own.data_at, own.data = begin + place, {}
    for index = place, finish - 1 do table.insert(own.data, at(index)) end
    own.used = begin + finish + 1
    return own
end

local function decode(bytes)
    local first, length = bytes[1], bytes[2]
    if first == 0xE5 then return { kind = "confirmation", used = 1 } end
    if first == 0xDC then
        if #bytes < 3 then return nil, "it is not complete", #bytes end
        return { kind = "token", da = bytes[2], sa = bytes[3], used = 3 }
    end
    if first == 0x10 then return body(bytes, 2, 0) end
    if first == 0xA2 then return body(bytes, 2, 8) end
    if first ~= 0x68 then return nil, REASONS.start, 1 end
    if length and (length < 4 or length > 249) then return nil, REASONS.length, 2 end
    if bytes[3] and bytes[3] ~= length then return nil, REASONS.length_repeated, 3 end
    if bytes[4] and bytes[4] ~= 0x68 then return nil, REASONS.start_repeated, 4 end
    if #bytes < 4 then return nil, "it is not complete", #bytes end
    return body(bytes, 5, length - 3)
end

-- Whether the 8 bytes in front can be a parameter channel.
local function looks_like_pkw(data, answer)
    local pke = word(data, 1)
    local ak, number = math.floor(pke / 4096), pke % 2048
    if ak == 0 then
        for place = 1, 8 do
            if data[place] ~= 0 then return false end
        end
        return true
    end
    if has(pke, 11) then return false end
    if answer and ak == 7 then return data[5] == 0 and data[6] == 0 and ERRORS[word(data, 7)] ~= nil end
    if not PARAMETERS[number] then return false end
    if answer then return ak <= 6 and ak ~= 3 end
    return ak <= 9
end

-- The PPO type of the data of a slave.
local function ppo_of(slave, data, answer)
    local fits = {}
    for _, ppo in ipairs(PPO) do
        if ppo[3] == #data then fits[ppo[1]] = ppo end
    end
    local wanted = fits[types[slave] or 0] or fits[nordac.prefs.ppo]
    if wanted then return wanted end
    if fits[1] and fits[4] then return looks_like_pkw(data, answer) and fits[1] or fits[4] end
    local _, only = next(fits)
    return only
end

local function quantity(number, unit)
    local step, places, name = unit[1], unit[2], unit[3]
    local all = math.abs(number * step)
    local text = string.format("%s%d", number < 0 and "-" or "", math.floor(all / 10 ^ places))
    if places > 0 then text = text .. "." .. string.format("%0" .. places .. "d", all % 10 ^ places) end
    if name ~= "" then text = text .. " " .. name end
    return text
end

-- A raw value, and what it means.
local function value(pkw, raw)
    local row = PARAMETERS[pkw.number]
    if not row then return string.format("%d", raw) end
    local number = row[2] and raw or raw % 0x10000
    if row[3] then number = signed(number, row[2] and 32 or 16) end
    local unit = row[5] and row[5][math.floor(pkw.ind / 256)] or row[4]
    if unit[1] == 1 and unit[2] == 0 then return string.format("%d", number) end
    return string.format("%d (%s)", number, quantity(number, unit))
end

local function named(pkw)
    local text = pkw.number .. " " .. (PARAMETER_NAMES[pkw.number] or "")
    if pkw.ind ~= 0 then text = text .. string.format(" IND %04X", pkw.ind) end
    return text
end

local function parameter_channel(data)
    local pke = word(data, 1)
    local high, low = word(data, 5), word(data, 7)
    return { ak = math.floor(pke / 4096), number = pke % 2048, ind = word(data, 3), raw = high * 65536 + low, low = low }
end

-- A task in words; nil where there is none.
local function asks(pkw)
    if pkw.ak == 0 then return nil end
    local row = TASKS[pkw.ak]
    if not row[2] then return row[1] .. ": " .. named(pkw) end
    pkw.value = value(pkw, pkw.raw)
    return row[1] .. ": " .. named(pkw) .. " = " .. pkw.value
end

-- An answer in words; nil where all bytes are 0.
local function says(pkw, data)
    if hex(data, 1, 8) == "00 00 00 00 00 00 00 00" then return nil end
    if pkw.ak == 3 or pkw.ak >= 8 then
        local groups = {}
        for place = 1, 7, 2 do table.insert(groups, string.format("%04X", word(data, place))) end
        return "no answer that the manual knows: " .. table.concat(groups, " ")
    end
    if pkw.ak == 7 then
        pkw.error = pkw.low
        local about = ERRORS[pkw.low] or "an error that this manual does not print"
        return string.format("%s refused: error %d (%s)", named(pkw), pkw.low, about)
    end
    if pkw.ak == 6 then
        pkw.value = string.format("%d", pkw.low)
        return named(pkw) .. " has " .. pkw.value .. " elements"
    end
    local raw = pkw.raw
    if pkw.ak == 0 then raw = 0 elseif pkw.ak == 1 or pkw.ak == 4 then raw = pkw.low end
    pkw.value = value(pkw, raw)
    return named(pkw) .. " = " .. pkw.value
end

-- The words, with the parameter set of bits 15 and 14 where it is not the first.
local function in_set(words, raw)
    local set = math.floor(raw / 0x4000)
    if set > 0 then table.insert(words, "set " .. set + 1) end
    return table.concat(words, ", ")
end

-- What a control word commands: by the priority of its bits, and what else is not as in normal operation (3.2.1, 3.3).
local function control(raw)
    local first = "ON"
    if not has(raw, 1) then
        first = "OFF2"
    elseif not has(raw, 2) then
        first = "OFF3"
    elseif not has(raw, 0) then
        first = "OFF1"
    elseif has(raw, 3) then
        first = "enable"
    end
    local words = { first }
    local more = {
        { 10, false, "not valid" }, { 4, false, "ramp to zero" }, { 5, false, "ramp stopped" }, { 6, false, "setpoint 0" },
        { 7, true, "acknowledge" }, { 11, true, "clockwise" }, { 12, true, "anticlockwise" },
    }
    for _, row in ipairs(more) do
        if has(raw, row[1]) == row[2] then table.insert(words, row[3]) end
    end
    return in_set(words, raw)
end

-- The state that a status word shows, and its other bits (3.2.2).
local function status_word(raw)
    local shown = raw % 16 + (has(raw, 6) and 0x40 or 0)
    local words = { "no state" }
    for _, row in ipairs(STATES) do
        if row[2] == shown and (row[3] == nil or row[3] ~= has(raw, 5)) then words[1] = row[1] end
    end
    for _, bit in ipairs({ 7, 8, 9, 10, 11, 12, 13 }) do
        if has(raw, bit) then table.insert(words, ZSW[bit]) end
    end
    if not has(raw, 4) then table.insert(words, "OFF2 active") end
    if not has(raw, 5) then table.insert(words, "OFF3 active") end
    return in_set(words, raw)
end

-- The process data: the words, and the parameter channel in front of them.
local function image(found, slave, data, answer)
    local ppo = ppo_of(slave, data, answer)
    if not ppo then
        found.odd = #data .. " bytes: 4, 12 or 20 are the PPO types (3.1)"
        return hex(data)
    end
    local place = ppo[4] and 9 or 1
    local first, main = word(data, place), word(data, place + 2)
    local says_first = answer and status_word(first) or control(first)
    local percent = signed(main, 16) * 100 / 16384
    found.image = { ppo = ppo[1], place = place, answer = answer, percent = percent, more = #data - place > 3 }
    local text = string.format("%s %04X (%s), %s %04X (%.1f %%)", answer and "ZSW" or "STW", first, says_first,
        answer and "HIW" or "HSW", main, percent)
    if found.image.more then
        text = text .. string.format(", PZD3 %04X, PZD4 %04X", word(data, place + 4), word(data, place + 6))
    end
    if not ppo[4] then return text end
    local pkw = parameter_channel(data)
    local said
    if answer then said = says(pkw, data) else said = asks(pkw) end
    if not said then return text end
    found.pkw = pkw
    return text .. "  " .. said
end

local function set_prm(found, data)
    if #data < 7 then
        found.odd = #data .. " bytes: at least 7 expected (EN 2)"
        return hex(data)
    end
    local words = {}
    for _, row in ipairs(PRM) do
        if math.floor(data[1] / row[1]) % 2 == 1 then table.insert(words, row[2]) end
    end
    found.prm = true
    if has(data[1], 3) then
        found.watchdog = data[2] * data[3] * 10
        table.insert(words, string.format("watchdog %d ms", found.watchdog))
    end
    table.insert(words, string.format("min T_SDR %d, ident %04X", data[4], word(data, 5)))
    if data[7] ~= 0 then table.insert(words, string.format("groups %02X", data[7])) end
    if #data > 7 then table.insert(words, "user data " .. hex(data, 8)) end
    return table.concat(words, ", ")
end

local function global_control(found, data)
    if #data ~= 2 then
        found.odd = #data .. " bytes: 2 expected (EN 2)"
        return hex(data)
    end
    local names = {}
    for _, row in ipairs(CONTROL) do
        if math.floor(data[1] / row[1]) % 2 == 1 then table.insert(names, row[2]) end
    end
    found.control = true
    local text = #names > 0 and table.concat(names, " ") or "operate"
    if data[2] ~= 0 then text = text .. string.format(", groups %02X", data[2]) end
    return text
end

local function diagnosis(found, data)
    if #data ~= 6 and not (#data == 8 and data[7] == 2) then
        found.odd = #data .. " bytes: 6, or 8 with a device block, expected (EN 2)"
        return hex(data)
    end
    local words = {}
    for _, row in ipairs(DIAGNOSIS) do
        if has(data[row[1]], row[2]) then table.insert(words, row[3]) end
    end
    found.diagnosis = table.concat(words, ", ")
    table.insert(words, data[4] == 255 and "no master" or string.format("master %d", data[4]))
    table.insert(words, string.format("ident %04X", word(data, 5)))
    if #data == 8 then table.insert(words, string.format("device block %02X", data[8])) end
    return table.concat(words, ", ")
end

-- The PPO type of a configuration; nil where it is of none.
local function configuration(data)
    for _, ppo in ipairs(PPO) do
        if ppo[2] == hex(data) then return ppo[1] end
    end
    return nil
end

local function request(found, own)
    local data, service = own.data, found.service
    if service == SERVICES[61] then return set_prm(found, data) end
    if service == SERVICES[58] then return global_control(found, data) end
    if service == SERVICES[62] then
        local ppo = configuration(data)
        if not ppo then return hex(data) end
        types[own.da], found.ppo = ppo, ppo
        return "PPO" .. ppo
    end
    if service == SERVICES.none then return image(found, own.da, data, false) end
    return hex(data)
end

local function answer(found, own)
    local data, service = own.data, found.service
    if service == SERVICES[60] then return diagnosis(found, data) end
    if service == SERVICES[59] then
        found.ppo = configuration(data)
        return found.ppo and "PPO" .. found.ppo or hex(data)
    end
    if service == SERVICES.none or service == SERVICES[56] then return image(found, own.sa, data, true) end
    return hex(data)
end

-- Whether a request repeats the last one of its master (EN 1).
local function repeats(own)
    local fcb, fcv = has(own.fc, 5), has(own.fc, 4)
    local key = own.sa * 2 + (fcb and 1 or 0)
    if fcv and records[own.da] == key then return true end
    records[own.da] = (fcb or fcv) and key or nil
    return false
end

local function pdu(found, own, number)
    local code = own.fc % 16
    local row = FUNCTIONS[code]
    if has(own.fc, 6) and row then
        local sends = row[2] == "srd" or row[2] == "sdn"
        local service = SERVICES.none
        if own.dsap then service = SERVICES[own.dsap] end
        found.request, found.code = true, row[1]
        if not sends or not service then
            asked, found.service, found.meaning = nil, row[1], ""
            return
        end
        asked, found.service = { slave = own.da, service = service, number = number }, service
        found.meaning = request(found, own)
        if row[2] == "srd" then found.repeated = repeats(own) end
        return
    end
    local known = asked and asked.slave == own.sa and asked or nil
    found.service = known and known.service or "FDL status"
    found.request_in = known and known.number
    local status = not has(own.fc, 6) and STATUS[code] or nil
    found.code = status
    if status == STATUS[0] then
        found.meaning = "OK"
    elseif status == STATUS[3] then
        found.meaning, found.refused = "RS: no service activated", "The slave refuses the service: no service activated (RS)"
    elseif status and known then
        found.meaning = (status == STATUS[10] and "diagnosis waits; " or "") .. answer(found, own)
    else
        found.meaning = status or string.format("FC %02X", own.fc)
    end
    if found.pkw and found.pkw.error then
        found.refused = string.format("The inverter refuses the task: error %d", found.pkw.error)
    end
end

local function see(bytes, event, comment, number)
    local found = { service = "no telegram", meaning = "" }
    local error = LINE_ERRORS[event]
    if event == LOST or #bytes == 0 then
        found.service, found.meaning, found.status = "lost", "nothing arrived", "lost"
        return found
    end
    if error then
        -- The event names the first error, and the comment its byte.
        local place = comment:match("byte (%d+) " .. error)
        local which = place and "byte " .. place or "a byte"
        found.service, found.meaning, found.status = "damaged", which .. " has a " .. error .. " error", error
        return found
    end
    local own, reason, place, sum = decode(bytes)
    if own and own.used < #bytes then
        own, reason, place = nil, string.format("more than %d bytes", own.used), own.used + 1
    end
    if not own then
        found.meaning, found.reason, found.reason_at, found.bad_sum = reason, reason, place, sum
        return found
    end
    found.own = own
    if own.kind == "confirmation" then
        found.service, found.meaning = asked and asked.service or "SC", "confirmed"
        found.request_in = asked and asked.number
    elseif own.kind == "token" then
        found.service, found.meaning = "token", string.format("%d gives it to %d", own.sa, own.da)
    else
        pdu(found, own, number)
    end
    return found
end

local function show_image(found, own, tvb, root)
    local shown = found.image
    -- Places count from 1 in tables and from 0 in the buffer.
    local at = own.data_at - 1
    root:add(F.ppo, shown.ppo):set_generated()
    local words = at + shown.place - 1
    local first = tvb(words, 2)
    local tree = root:add(shown.answer and F.zsw or F.stw, first)
    for _, field in ipairs(shown.answer and ZSW_FIELDS or STW_FIELDS) do tree:add(field, first) end
    root:add(shown.answer and F.hiw or F.hsw, tvb(words + 2, 2), shown.percent)
    if shown.more then
        root:add(F.pzd3, tvb(words + 4, 2))
        root:add(F.pzd4, tvb(words + 6, 2))
    end
    local pkw = found.pkw
    if not pkw then return end
    tree = root:add(F.pkw, tvb(at, 8))
    tree:add(shown.answer and F.answer or F.task, tvb(at, 2))
    tree:add(F.parameter, tvb(at, 2))
    tree:add(F.index, tvb(at + 2, 2))
    if pkw.value then tree:add(F.value, tvb(at + 4, 4), pkw.value) end
    if pkw.error then tree:add(F.error, tvb(at + 6, 2)) end
end

local function show_pdu(found, own, tvb, root)
    local at = own.begin - 1
    root:add(F.da, tvb(at, 1))
    root:add(F.sa, tvb(at + 1, 1))
    local control = root:add(F.fc, tvb(at + 2, 1))
    if found.request then
        control:add(F.fcb, tvb(at + 2, 1))
        control:add(F.fcv, tvb(at + 2, 1))
    end
    if found.code then control:add(found.request and F.function_name or F.reply, tvb(at + 2, 1), found.code) end
    if own.dsap then root:add(F.dsap, tvb(own.dsap_at - 1, 1)) end
    if own.ssap then root:add(F.ssap, tvb(own.ssap_at - 1, 1)) end
    local data = own.data_at - 1
    if #own.data > 0 then root:add(F.data, tvb(data, #own.data)) end
    if found.ppo then root:add(F.ppo, tvb(data, #own.data), found.ppo) end
    if found.prm then
        if found.watchdog then root:add(F.watchdog, tvb(data + 1, 2), found.watchdog) end
        root:add(F.min_tsdr, tvb(data + 3, 1))
        root:add(F.ident, tvb(data + 4, 2))
        root:add(F.group, tvb(data + 6, 1))
    end
    if found.control then root:add(F.group, tvb(data + 1, 1)) end
    if found.diagnosis then
        root:add(F.diagnosis, tvb(data, 3), found.diagnosis)
        root:add(F.master, tvb(data + 3, 1))
        root:add(F.ident, tvb(data + 4, 2))
    end
    if found.image then show_image(found, own, tvb, root) end
    root:add(F.fcs, tvb(own.fcs - 1, 1))
    root:add(F.fcs_good, tvb(own.fcs - 1, 1), true):set_generated()
end

local function experts(found, root)
    if found.status then root:add_proto_expert_info(bad_status, "Damaged on the line: " .. found.status) end
    if found.bad_sum then
        root:add_proto_expert_info(bad_fcs, "FCS does not fit")
    elseif found.reason then
        root:add_proto_expert_info(no_telegram, "No telegram: " .. found.reason)
    end
    if found.odd then root:add_proto_expert_info(bad_length, found.odd) end
    if found.repeated then root:add_proto_expert_info(repeated, "The slave sends its last reply again and executes nothing") end
    if found.refused then root:add_proto_expert_info(refused, found.refused) end
end

-- The telegrams of a packet. A packet of a station's own interface is one; adapters give several, a request and its reply too, in one packet
-- of an interface that is no station's. Where not all of it is telegrams, it is shown as one.
local function telegrams(bytes, sender)
    local parts, at = {}, 1
    local of_station = sender == "master" or sender:match("^slave %d+$")
    while not of_station and at <= #bytes do
        local rest = { table.unpack(bytes, at) }
        local own = decode(rest)
        if not own then return { { at = 1, bytes = bytes } } end
        table.insert(parts, { at = at, bytes = { table.unpack(rest, 1, own.used) } })
        at = at + own.used
    end
    return #parts > 0 and parts or { { at = 1, bytes = bytes } }
end

local function show(found, sender, tvb, tree)
    local own = found.own
    local root = tree:add(nordac, tvb(), "NORDAC, " .. found.text)
    root:add(F.sender, sender):set_generated()
    root:add(F.service, found.service):set_generated()
    root:add(F.meaning, found.meaning):set_generated()
    root:add(F.status, found.status or "ok"):set_generated()
    if found.request_in then root:add(F.request_in, found.request_in):set_generated() end
    if own and own.kind == "pdu" then show_pdu(found, own, tvb, root) end
    experts(found, root)
end

function nordac.dissector(tvb, pinfo, tree)
    local sender = tostring(interface_name() or "")
    local event = event_type() and event_type().value or 0x04
    if not seen[pinfo.number] then
        local bytes, all = {}, {}
        for place = 0, tvb:len() - 1 do bytes[place + 1] = tvb(place, 1):uint() end
        for _, part in ipairs(telegrams(bytes, sender)) do
            local found = see(part.bytes, event, tostring(packet_comment() or ""), pinfo.number)
            found.text = found.service .. (found.meaning ~= "" and "  " .. found.meaning or "")
            found.at, found.length = part.at - 1, #part.bytes
            table.insert(all, found)
        end
        seen[pinfo.number] = all
    end
    local all, texts = seen[pinfo.number], {}
    for _, found in ipairs(all) do table.insert(texts, found.text) end
    pinfo.cols.protocol = "NORDAC"
    pinfo.cols.info = sender .. "  " .. table.concat(texts, " | ")
    local own = all[1].own
    if own and own.da then
        pinfo.cols.src = tostring(own.sa)
        pinfo.cols.dst = own.da == 127 and "all" or tostring(own.da)
    end
    for _, found in ipairs(all) do
        local part = found.length > 0 and #all > 1 and tvb(found.at, found.length):tvb() or tvb
        show(found, sender, part, tree)
    end
    return tvb:len()
end

DissectorTable.get("rtacser.data"):add_for_decode_as(nordac)
