#!/usr/bin/env bash
# python-can 4.6.1: behind a bus-off that a server of socketcand reports, `bus.state` is ACTIVE.
#
# Source: doc/protocol.md of linux-can/socketcand, "Error frame transmission": `< error class seconds.useconds >`, the class as in linux/can/error.h:
# 040 is bus-off, 002 lost arbitration. The documentation of python-can, `Bus.state`: "Return the current state of the hardware". The interface
# socketcand has no `state` of its own (can/interfaces/socketcand/socketcand.py), and that of can/bus.py is always ACTIVE.
# Behaviour: a program that asks for the state goes on with a bus on which nothing is sent. Only the identifier of the error frame shows it.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 || exit 2

expected=$(cat <<'END'
lost arbitration: error frame 002, state ACTIVE
bus-off: error frame 040, state ACTIVE
END
)
seen=$(timeout 20 v/bin/python - 2>&1 <<'END'
import socket
import threading

import can

server = socket.create_server(("127.0.0.1", 0))

def serve():
    client, _ = server.accept()
    client.sendall(b"< hi >")
    client.recv(100)
    client.sendall(b"< ok >")
    client.recv(100)
    client.sendall(b"< ok >")
    for text in (b"< error 002 23.424242 >", b"< error 040 23.424243 >"):
        threading.Event().wait(0.3)
        client.sendall(text)
    threading.Event().wait(5)

threading.Thread(target=serve, daemon=True).start()
with can.Bus(interface="socketcand", host="127.0.0.1", port=server.getsockname()[1], channel="can0") as bus:
    for what in ("lost arbitration", "bus-off"):
        own = bus.recv(2)
        print(f"{what}: error frame {own.arbitration_id:03X}, state {bus.state.name}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
