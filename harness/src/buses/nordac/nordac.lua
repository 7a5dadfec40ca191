-- NORDAC vector on PROFIBUS DP (EN 50170; NORDAC manual, chapters 3 and 5) for Wireshark and tshark, from 4.0 on.
--
-- It reads what `drivebench trace --format pcapng` writes: link type 250 (LINKTYPE_RTAC_SERIAL) with one telegram a packet.
--
--     drivebench dissector --bus nordac > nordac.lua
--     tshark -X lua_script:nordac.lua -d rtacser.data,nordac -r drive.pcapng
--     wireshark -X lua_script:nordac.lua drive.pcapng       (and "Decode As...": RTAC Serial, NORDAC)
--
-- A reply has no mark of its own: it has the service of the request before it. The PPO type of a slave is that of its last Chk_Cfg; before
-- one it follows from the length. Both are kept while the capture is read in order, and what a packet is, by its number.

local nordac = Proto("nordac", "NORDAC on PROFIBUS DP")

-- Name, step, decimal places, unit, bits, whether it is signed: one row a parameter.
local PARAMETERS = {
@PARAMETERS@
}
-- Names of bits, and of error numbers of the parameter channel.
local BITS = {
@BITS@
}
local ERRORS = {
@ERRORS@
}
local SERVICES = {
@SERVICES@
}
local FUNCTIONS = {
@FUNCTIONS@
}
local TASKS = {
@TASKS@
}
local ANSWERS = { [0] = "no answer", "value, word", "value, double word", [4] = "array value, word", [5] = "array value, double word",
    [6] = "number of array elements", [7] = "not executable" }
local STATUSES = { [0] = "OK", [3] = "RS", [8] = "DL", [10] = "DH" }
local STATES = { [0x40] = "SD", [0x01] = "RDY", [0x03] = "RO", [0x07] = "OE", [0x0F] = "FR", [0x08] = "F", [0x00] = "NR" }
local CONFIGURATIONS = { F3F1 = 1, F3F5 = 2, F1 = 3, F5 = 4 }
-- Octets of a PPO type, and where its process words begin.
local LENGTHS = { 12, 20, 4, 12 }
local WORDS = { 8, 8, 0, 0 }
local LINE = { [0x02] = "ok", [0x07] = "framing", [0x08] = "parity", [0x09] = "break", [0x0A] = "overrun" }

local F = {
    da = ProtoField.uint8("nordac.da", "Destination", base.DEC, nil, 0x7F),
    sa = ProtoField.uint8("nordac.sa", "Source", base.DEC, nil, 0x7F),
    fc = ProtoField.uint8("nordac.fc", "Frame control", base.HEX),
    fcb = ProtoField.bool("nordac.fcb", "Frame count bit", 8, nil, 0x20),
    fcv = ProtoField.bool("nordac.fcv", "Frame count bit counts", 8, nil, 0x10),
    kind = ProtoField.string("nordac.kind", "Function or status"),
    service = ProtoField.string("nordac.service", "Service"),
    dsap = ProtoField.uint8("nordac.dsap", "Service access point at the destination", base.DEC),
    ssap = ProtoField.uint8("nordac.ssap", "Service access point at the source", base.DEC),
    data = ProtoField.bytes("nordac.data", "Data"),
    ppo = ProtoField.uint8("nordac.ppo", "PPO type", base.DEC),
    stw = ProtoField.uint16("nordac.stw", "Control word STW", base.HEX),
    zsw = ProtoField.uint16("nordac.zsw", "Status word ZSW", base.HEX),
    state = ProtoField.string("nordac.state", "State"),
    bit = ProtoField.string("nordac.bit", "Bit"),
    hsw = ProtoField.int16("nordac.hsw", "Main setpoint HSW", base.DEC),
    hiw = ProtoField.int16("nordac.hiw", "Main actual value HIW", base.DEC),
    percent = ProtoField.string("nordac.percent", "Per cent of 4000h"),
    ak = ProtoField.string("nordac.ak", "Task or answer"),
    pnu = ProtoField.uint16("nordac.pnu", "Parameter", base.DEC),
    name = ProtoField.string("nordac.name", "Name"),
    ind = ProtoField.uint16("nordac.ind", "Index IND", base.HEX),
    pwe = ProtoField.uint32("nordac.pwe", "Value PWE", base.HEX),
    value = ProtoField.string("nordac.value", "Value"),
    fcs_good = ProtoField.bool("nordac.fcs.good", "FCS fits"),
    status = ProtoField.string("nordac.status", "Line status"),
}
nordac.fields = {}
for _, field in pairs(F) do table.insert(nordac.fields, field) end

local damaged = ProtoExpert.new("nordac.damaged", "Damaged on the line", expert.group.CHECKSUM, expert.severity.ERROR)
local no_telegram = ProtoExpert.new("nordac.no_telegram", "No telegram (EN 1)", expert.group.MALFORMED, expert.severity.ERROR)
nordac.experts = { damaged, no_telegram }

local event_type = Field.new("rtacser.eventtype")

-- The service of the last request and its slave; PPO types by slave; what is known of each packet.
local asked, types, seen = nil, {}, {}

function nordac.init()
    asked, types, seen = nil, {}, {}
end

-- The bounds of addresses and payload, or why the octets are no telegram.
local function frame(buffer)
    local length = buffer:len()
    local start = buffer(0, 1):uint()
    local first, size
    if start == 0xE5 and length == 1 then return { confirmation = true } end
    if start == 0xDC and length == 3 then return { token = true } end
    if start == 0x10 then first, size = 1, 3
    elseif start == 0xA2 then first, size = 1, 11
    elseif start == 0x68 and length > 4 and buffer(1, 1):uint() == buffer(2, 1):uint() and buffer(3, 1):uint() == 0x68 then
        first, size = 4, buffer(1, 1):uint()
    else return nil, "wrong start or length" end
    if size < 3 or length ~= first + size + 2 then return nil, "wrong length" end
    if buffer(length - 1, 1):uint() ~= 0x16 then return nil, "the last octet is not 16" end
    local sum = 0
    for index = first, first + size - 1 do sum = (sum + buffer(index, 1):uint()) % 256 end
    return { first = first, payload = first + 3, size = size - 3, good = sum == buffer(length - 2, 1):uint() }
end

-- What a telegram is, from those before it.
local function see(buffer, own)
    local da, sa, fc = buffer(own.first, 1):uint(), buffer(own.first + 1, 1):uint(), buffer(own.first + 2, 1):uint()
    local what = { da = da % 128, sa = sa % 128, fc = fc, request = fc % 128 >= 64 }
    local at, left = own.payload, own.size
    for _, side in ipairs({ { "dsap", da }, { "ssap", sa } }) do
        if side[2] >= 128 and left > 0 then
            what[side[1]] = buffer(at, 1):uint()
            at, left = at + 1, left - 1
        end
    end
    what.at, what.left = at, left
    local code = fc % 16
    if what.request then
        what.kind = FUNCTIONS[code] or "unknown function"
        what.slave = what.da
        local carries = code == 12 or code == 13 or code == 4 or code == 6
        what.service = carries and SERVICES[what.dsap or -1] or what.kind
        asked = { slave = what.da, service = what.service }
        if what.service == "Chk_Cfg" and left > 0 then
            types[what.da] = CONFIGURATIONS[tostring(buffer(at, left):bytes()):upper()]
        end
    else
        what.kind = STATUSES[code] or "unknown status"
        what.slave = what.sa
        what.service = asked and asked.slave == what.sa and asked.service or "reply"
        what.refused = code == 3
    end
    if what.service == "Data_Exchange" and left > 0 then
        local known = types[what.slave]
        if not (known and LENGTHS[known] == left) then
            for ppo, length in ipairs(LENGTHS) do
                if length == left then known = ppo break end
            end
        end
        if known and LENGTHS[known] == left then what.ppo = known end
    end
    return what
end

local function bits_of(word, names)
    local found = {}
    for number = 0, 15 do
        if math.floor(word / 2 ^ number) % 2 == 1 and names[number] then table.insert(found, names[number]) end
    end
    return found
end

local function state_of(word)
    local bits = word % 16 + (math.floor(word / 64) % 2) * 64
    if bits == 7 and math.floor(word / 32) % 2 == 0 then return "QS" end
    return STATES[bits] or "no state"
end

local function value_of(row, raw)
    if not row then return tostring(raw) end
    local bits = row[5]
    if bits == 16 then raw = raw % 65536 end
    if row[6] and raw >= 2 ^ (bits - 1) then raw = raw - 2 ^ bits end
    if row[4] == "" and row[3] == 0 then return string.format("%d", raw) end
    return string.format("%." .. row[3] .. "f", raw * row[2] / 10 ^ row[3]) .. (row[4] ~= "" and " " .. row[4] or "")
end

-- The parameter channel: adds its fields, and gives it in words.
local function channel(root, range, request)
    local pke, ind, pwe = range(0, 2):uint(), range(2, 2):uint(), range(4, 4):uint()
    local ak, pnu = math.floor(pke / 4096), pke % 2048
    local name = (request and TASKS or ANSWERS)[ak] or "invalid"
    root:add(F.ak, range(0, 2), name)
    if ak == 0 then return nil end
    local row = PARAMETERS[pnu]
    root:add(F.pnu, range(0, 2), pnu)
    if row then root:add(F.name, range(0, 2), row[1]) end
    root:add(F.ind, range(2, 2))
    root:add(F.pwe, range(4, 4))
    local value
    if not request and ak == 7 then value = "error " .. pwe .. " (" .. (ERRORS[pwe] or "not printed") .. ")"
    elseif not request and ak == 6 then value = pwe .. " elements"
    elseif not request or ak == 2 or ak == 3 or ak == 7 or ak == 8 then value = value_of(row, pwe) end
    if value then root:add(F.value, range(4, 4), value) end
    local index = ind > 0 and string.format(" IND %04X", ind) or ""
    return pnu .. (row and " " .. row[1] or "") .. index .. (value and " = " .. value or "?")
end

-- The process words.
local function process(root, range, request)
    local word, main = range(0, 2):uint(), range(2, 2):int()
    local item = root:add(request and F.stw or F.zsw, range(0, 2))
    local text = string.format(request and "STW %04X" or "ZSW %04X", word)
    for _, name in ipairs(bits_of(word, request and BITS.stw or BITS.zsw)) do item:add(F.bit, range(0, 2), name) end
    if not request then
        root:add(F.state, range(0, 2), state_of(word))
        text = text .. " " .. state_of(word)
    end
    root:add(request and F.hsw or F.hiw, range(2, 2))
    local percent = string.format("%.1f %%", main * 100 / 16384)
    root:add(F.percent, range(2, 2), percent)
    return text .. (request and ", HSW " or ", HIW ") .. percent
end

function nordac.dissector(buffer, pinfo, tree)
    local length = buffer:len()
    if length == 0 then return 0 end
    local event = event_type()
    local status = event and LINE[event.value] or "ok"
    pinfo.cols.protocol = "NORDAC"
    local root = tree:add(nordac, buffer(), "NORDAC on PROFIBUS DP")
    local item = root:add(F.status, status):set_generated()
    if status ~= "ok" then
        item:add_proto_expert_info(damaged, "Damaged on the line: " .. status)
        pinfo.cols.info = "damaged: " .. status
        return length
    end
    local own, why = frame(buffer)
    if not own or own.good == false then
        root:add_proto_expert_info(no_telegram, why or "FCS does not fit")
        pinfo.cols.info = "no telegram: " .. (why or "FCS does not fit")
        return length
    end
    if own.confirmation then
        local service = seen[pinfo.number] or { service = asked and asked.service or "SC" }
        seen[pinfo.number] = service
        root:add(F.service, service.service)
        pinfo.cols.info = service.service .. " confirmed"
        return length
    end
    if own.token then
        pinfo.cols.info = "token"
        return length
    end
    local what = seen[pinfo.number]
    if not what then
        what = see(buffer, own)
        seen[pinfo.number] = what
    end
    root:add(F.da, buffer(own.first, 1))
    root:add(F.sa, buffer(own.first + 1, 1))
    local control = buffer(own.first + 2, 1)
    root:add(F.fc, control)
    if what.request then
        root:add(F.fcb, control)
        root:add(F.fcv, control)
    end
    root:add(F.kind, control, what.kind)
    root:add(F.service, what.service):set_generated()
    if what.dsap then root:add(F.dsap, what.dsap) end
    if what.ssap then root:add(F.ssap, what.ssap) end
    root:add(F.fcs_good, true):set_generated()
    local words = what.refused and "RS" or ""
    if what.left > 0 then
        local data = buffer(what.at, what.left)
        root:add(F.data, data)
        if what.ppo then
            root:add(F.ppo, what.ppo):set_generated()
            words = process(root, data(WORDS[what.ppo]), what.request)
            if WORDS[what.ppo] == 8 then
                local more = channel(root, data(0, 8), what.request)
                if more then words = words .. "  " .. more end
            end
        else
            words = tostring(data:bytes())
        end
    end
    pinfo.cols.info = what.sa .. "->" .. what.da .. "  " .. what.service .. "  " .. words
    return length
end

DissectorTable.get("rtacser.data"):add_for_decode_as(nordac)
