#!/usr/bin/env bash
# pyserial 3.5 with glibc 2.36 on Linux: a pseudo terminal with parity is opened once; the second time the same call fails with `Invalid argument`.
#
# Source: POSIX, `tcsetattr`: success if any of the requested changes could be made. A pseudo terminal of Linux drops PARENB, and glibc therefore compares what
# was asked for with what is set, and returns EINVAL where nothing else was changed. pyserial (serial/serialposix.py, `_reconfigure_port`) passes that on as
# `termios.error`, which is no SerialException.
# Behaviour: a master in Python with 8O1, as a ring of ND21s has it, runs on a simulated port, and not again without a new pseudo terminal or 8N1 between.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check pyserial==3.5 || exit 2

expected=$(cat <<'END'
8N1, first time: opened
8N1, second time: opened
8O1, first time: opened
8O1, second time: error (22, 'Invalid argument')
END
)
seen=$(v/bin/python - 2>&1 <<'END'
import os
import pty

import serial

for parity in "NO":
    _, theirs = pty.openpty()
    for attempt in ("first", "second"):
        try:
            with serial.Serial(os.ttyname(theirs), 38400, parity=parity):
                what = "opened"
        except Exception as error:
            what = f"{type(error).__name__} {error}"
        print(f"8{parity}1, {attempt} time: {what}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
