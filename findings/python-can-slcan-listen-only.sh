#!/usr/bin/env bash
# python-can 4.6.1 with the firmware of CANable: with `listen_only=True` the channel is not opened, and nothing says so.
#
# Source: can/interfaces/slcan.py sends `L`, as LAWICEL's manuals have it, and does not look at the answer (CR for done, BEL for refused). The
# firmware of CANable has no `L`: its silent mode is `M1`, sent before `O` (slcan.c of canable-fw, commit 4c6e4ac).
# Behaviour: the adapter refuses `L` with BEL, its channel stays closed, and `can.Bus(...)` succeeds. `recv` returns None for ever, as on a silent bus.
# Seen: the lines below `expected`; the bus has a frame whenever the channel is open.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 pyserial==3.5 || exit 2

expected=$(cat <<'END'
listen_only=False: frames: True; C done, S6 done, O done
listen_only=True: frames: False; C done, S6 done, L refused
END
)
seen=$(v/bin/python - 2>&1 <<'END'
import os
import pty
import threading
import tty

import can


def adapter(said):
    """A pseudo terminal with the dialect of the firmware; a frame is on the bus behind each opening."""
    here, there = pty.openpty()
    tty.setraw(here)
    tty.setraw(there)

    def answer():
        text = b""
        while piece := os.read(here, 100):
            *lines, text = (text + piece).split(b"\r")
            for line in filter(None, lines):
                done = line[:1] in b"OCSMA"
                said.append(f"{line.decode()} {'done' if done else 'refused'}")
                os.write(here, b"\r" if done else b"\a")
                if line == b"O":
                    os.write(here, b"t181440810100\r")

    threading.Thread(target=answer, daemon=True).start()
    return os.ttyname(there)


for listen_only in (False, True):
    said = []
    with can.Bus(interface="slcan", channel=adapter(said), bitrate=500000, sleep_after_open=0, listen_only=listen_only) as bus:
        heard = [message for _ in range(20) if (message := bus.recv(0.05))]
    print(f"listen_only={listen_only}: frames: {len(heard) > 0}; {', '.join(dict.fromkeys(said))}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
