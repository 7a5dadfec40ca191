#!/usr/bin/env bash
# python-can 4.6.1 with the firmware of CANable 2: the answer to `V` is read as a frame of CAN FD.
#
# Source: canable2-fw answers `V` with its commit and its repository, `b158aa7 github.com/normaldotcom/canable2.git`; LAWICEL's manual of the CAN232
# has `V` and four digits. can/interfaces/slcan.py, `get_version`, keeps other lines for `recv`, where `b` begins a frame with a bit rate switch.
# Behaviour: `get_version` knows no version, and the next `recv` raises ValueError: the commit begins with `b`, as one in sixteen does. Commits that
# begin with `d` are read the same way.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 pyserial==3.5 || exit 2

expected=$(cat <<'END'
b158aa7 (None, None) ValueError
a158aa7 (None, None) None
END
)
seen=$(v/bin/python - 2>&1 <<'END'
import os
import pty
import threading
import tty

import can


def adapter(commit):
    """A pseudo terminal with the dialect of the firmware: no CR, no BEL, and an answer to V."""
    here, there = pty.openpty()
    tty.setraw(here)
    tty.setraw(there)

    def answer():
        text = b""
        while piece := os.read(here, 100):
            *lines, text = (text + piece).split(b"\r")
            for line in lines:
                if line == b"V":
                    os.write(here, commit + b" github.com/normaldotcom/canable2.git\r")

    threading.Thread(target=answer, daemon=True).start()
    return os.ttyname(there)


for commit in (b"b158aa7", b"a158aa7"):
    with can.Bus(interface="slcan", channel=adapter(commit), bitrate=500000, sleep_after_open=0) as bus:
        print(commit.decode(), bus.get_version(2), end=" ")
        try:
            print(bus.recv(1))
        except ValueError:
            print("ValueError")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
