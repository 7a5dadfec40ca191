#!/usr/bin/env bash
# python-can 4.6.1: the constructor of the socketcand interface refuses a frame behind `< ok >`.
#
# Source: doc/protocol.md of linux-can/socketcand: behind `< rawmode >` "every frame on the bus will immediately be received", in one stream.
# can/interfaces/socketcand/socketcand.py, `_expect_msg`, compares all that one `recv(256)` returns with the message.
# Behaviour: a frame that is on the bus right behind `< rawmode >` arrives in the same TCP segment as `< ok >`. `can.Bus(...)` then fails with
# CanError. On a bus with traffic some connections fail and others do not.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 || exit 2

expected=$(cat <<'END'
0.5 s behind: 181#40810100
0 s behind: CanError: Expected '< ok >' got: '< ok >< frame 181 23.424242 40810100 >'
END
)
seen=$(v/bin/python - 2>&1 <<'END'
import socket
import threading
import time

import can


def server(pause):
    """A daemon on a bus that has a frame `pause` seconds behind the answer to `rawmode`; no pause: in its segment."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve():
        client, _ = listener.accept()
        for answer in (b"< hi >", b"< ok >"):
            client.sendall(answer)
            client.recv(100)
        last = [b"< ok >", b"< frame 181 23.424242 40810100 >"]
        for piece in last if pause else [b"".join(last)]:
            client.sendall(piece)
            time.sleep(pause)
        client.recv(100)

    threading.Thread(target=serve, daemon=True).start()
    return listener.getsockname()[1]


for pause in (0.5, 0):
    try:
        with can.Bus(interface="socketcand", host="127.0.0.1", port=server(pause), channel="can0") as bus:
            message = bus.recv(10)
            print(f"{pause} s behind: {message.arbitration_id:03X}#{message.data.hex().upper()}")
    except can.CanError as error:
        print(f"{pause} s behind: CanError: {error}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
