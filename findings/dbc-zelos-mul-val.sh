#!/usr/bin/env bash
# zelos-can 0.0.10: a message that has SG_MUL_VAL_ lines is not decoded, even where these lines repeat what its simple multiplexing says.
#
# Source: the DBC format has SG_MUL_VAL_ lines for extended multiplexing; writers add them to messages with one level too. The same signals without these lines are decoded.
# Behaviour: CanDecoder warns "extended multiplexing is not supported; this message is not decoded" and counts the frames as unknown.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check zelos-can==0.0.10 zelos-sdk==0.0.13a2 >/dev/null 2>&1 || exit 2

cat >plain.dbc <<'END'
VERSION ""

NS_ :

BS_:

BU_: A B

BO_ 513 Rx: 3 A
 SG_ REGID M : 0|8@1+ (1,0) [0|255] "" B
 SG_ SPEED m49 : 8|16@1- (1,0) [0|0] "" B
END
{
    cat plain.dbc
    printf '\nSG_MUL_VAL_ 513 SPEED REGID 49-49;\n'
} >lines.dbc
expected=$(cat <<'END'
plain: decoded 1, unknown 0
lines: decoded 0, unknown 1
END
)
seen=$(for kind in plain lines; do
    v/bin/python - "$kind" 2>/dev/null <<'END' | grep '^[a-z]*: '
import sys
import zelos_can
decoder = zelos_can.CanDecoder(database_file=f"{sys.argv[1]}.dbc", source_name=sys.argv[1])
decoder.decode_frame(0x201, bytes.fromhex("31CD0C"))
metrics = decoder.metrics()
print(f"{sys.argv[1]}: decoded {metrics.messages_decoded}, unknown {metrics.unknown_messages}")
END
done)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
