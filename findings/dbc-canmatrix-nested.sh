#!/usr/bin/env bash
# canmatrix 1.2: a DBC with a multiplexer inside another becomes an ARXML file without frames and a KCD file that says something else, with exit code 0.
#
# Source: canconvert's documentation lists DBC with "multiplex" as read, and ARXML and KCD as written. cantools 45.1.0 reads both DBC files here in the same way.
# Behaviour: `READ m61M` under `REGID M` with `INTERVAL m0` under READ. canconvert logs that complex multiplexers are not supported in ARXML, ignores the
# frame and exits with 0. In KCD the selector REGID is gone: READ selects everything, so the request 3D 31 00 reads as a set point.
# With one level, `READ m61` and `INTERVAL m61`, both files are complete.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check canmatrix==1.2 cantools==45.1.0 lxml >/dev/null 2>&1 || exit 2

dbc() {
    printf 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: A B\n\nBO_ 513 Rx: 5 A\n SG_ REGID M : 0|8@1+ (1,0) [0|255] "" B\n'
    printf ' SG_ READ m61%s : 8|8@1+ (1,0) [0|255] "" B\n SG_ INTERVAL %s : 16|8@1+ (1,0) [0|255] "" B\n' "$1" "$2"
    printf ' SG_ SPEED m49 : 8|16@1- (1,0) [0|0] "" B\n'
}
{
    dbc M m0
    printf '\nSG_MUL_VAL_ 513 READ REGID 61-61;\nSG_MUL_VAL_ 513 INTERVAL READ 0-255;\nSG_MUL_VAL_ 513 SPEED REGID 49-49;\n'
} >nested.dbc
dbc '' m61 >flat.dbc
expected=$(cat <<'END'
nested: dbc {'REGID': 61, 'READ': 49, 'INTERVAL': 0}
nested: kcd {'READ': 49, 'SPEED': 49}
nested: exit 0, 0 frames in ARXML
flat: dbc {'REGID': 61, 'READ': 49, 'INTERVAL': 0}
flat: kcd {'REGID': 61, 'READ': 49, 'INTERVAL': 0}
flat: exit 0, 1 frames in ARXML
END
)
seen=$(for kind in nested flat; do
    v/bin/canconvert $kind.dbc $kind.kcd >/dev/null 2>&1 || exit 2
    v/bin/canconvert $kind.dbc $kind.arxml >/dev/null 2>&1
    code=$?
    for form in dbc kcd; do
        v/bin/python - "$kind" "$form" <<'END'
import sys
import cantools
kind, form = sys.argv[1:]
rx = cantools.database.load_file(f"{kind}.{form}", strict=False).get_message_by_name("Rx")
print(f"{kind}: {form}", rx.decode(bytes.fromhex("3D3100"), allow_truncated=True))
END
    done
    echo "$kind: exit $code, $(grep -c '</CAN-FRAME>' $kind.arxml) frames in ARXML"
done)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
