#!/usr/bin/env bash
# python-can 4.6.1: over socketcand a remote frame is sent as a data frame without its data, and a received one is dropped.
#
# Source: doc/protocol.md of linux-can/socketcand: `< sendrtr can_id can_dlc >`, `< rtr can_id seconds.useconds can_dlc >`.
# can/interfaces/socketcand/socketcand.py has neither word.
# Behaviour: a remote frame with a length of 3 becomes `< send 201 3  >`, a data frame of 3 bytes with none. `< rtr ... >` becomes no message.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 || exit 2

expected=$(cat <<'END'
sent: < send 201 3  >
received: None
END
)
seen=$(v/bin/python - 2>/dev/null <<'END'
import can
from can.interfaces.socketcand import socketcand

remote = can.Message(arbitration_id=0x201, is_extended_id=False, is_remote_frame=True, dlc=3)
print("sent:", socketcand.convert_can_message_to_ascii_message(remote))
print("received:", socketcand.convert_ascii_message_to_can_message("< rtr 123 23.424242 4 >"))
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
