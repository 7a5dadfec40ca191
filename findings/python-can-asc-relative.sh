#!/usr/bin/env bash
# python-can 4.6.1: times of an ASC file with `timestamps relative` are not added up.
#
# Source: Vector's ASC format: with `timestamps relative` each time counts from the event before it. asc2log of can-utils adds them up.
# can/io/asc.py, `_extract_header`, notes the word and uses it for the start time only.
# Behaviour: three frames at 1, 2 and 102 ms are read as 1, 1 and 100 ms behind the start: a frame can seem to come before the one in front of it.
# Seen: the line below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 || exit 2

expected=$(cat <<'END'
0.001 0.001 0.100
END
)
cat >relative.asc <<'END'
date Sat Nov 28 10:00:00.000 am 2026
base hex  timestamps relative
no internal events logged
   0.001000 1  201             Rx   d 3 3D 40 00
   0.001000 1  181             Rx   d 4 40 81 01 00
   0.100000 1  201             Rx   d 3 3D 40 00
END
seen=$(v/bin/python - 2>&1 <<'END'
import can

with can.LogReader("relative.asc", relative_timestamp=True) as reader:
    print(*(f"{own.timestamp:.3f}" for own in reader))
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
