#!/usr/bin/env bash
# python-can 4.6.1: an error frame in a log of candump is read as a data frame with the identifier 4.
#
# Source: can-utils writes error frames with CAN_ERR_FLAG (20000000h, linux/can.h) in the eight digits of the identifier; its own log2long prints
# ERRORFRAME for the line. can/io/canutils.py, `CanutilsLogReader`, looks at the flag in the part behind `#` only.
# Behaviour: a drive, a filter or a DBC sees a frame with the 29-bit identifier 00000004 that never was on the bus.
# Seen: the line below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 || exit 2

expected=$(cat <<'END'
error frame: False, identifier 00000004, extended: True
END
)
printf '(1700000000.000000) can0 20000004#0008000000000000\n' >error.log
seen=$(v/bin/python - 2>&1 <<'END'
import can

with can.LogReader("error.log") as reader:
    for own in reader:
        print(f"error frame: {own.is_error_frame}, identifier {own.arbitration_id:08X}, extended: {own.is_extended_id}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
