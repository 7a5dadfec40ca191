#!/usr/bin/env bash
# python-can 4.6.1: of a frame of socketcand whose data bytes stand apart, only the first byte is kept.
#
# Source: doc/protocol.md of linux-can/socketcand, "Frame transmission": `< frame can_id seconds.useconds [data]* >`, with the example
# `< frame 123 23.424242 11 22 33 44 >`. can/interfaces/socketcand/socketcand.py, `convert_ascii_message_to_can_message`, takes one word of data.
# Behaviour: the example of the protocol is read as a frame of one byte, without a warning. The daemon itself writes the bytes together in raw
# mode, so the difference shows with other servers of the protocol.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
python3 -m venv v && v/bin/pip install --quiet --disable-pip-version-check python-can==4.6.1 || exit 2

expected=$(cat <<'END'
< frame 123 23.424242 11223344 > -> 4 bytes, 11 22 33 44
< frame 123 23.424242 11 22 33 44 > -> 1 bytes, 11
END
)
seen=$(v/bin/python - 2>&1 <<'END'
from can.interfaces.socketcand.socketcand import convert_ascii_message_to_can_message as read

for text in ("< frame 123 23.424242 11223344 >", "< frame 123 23.424242 11 22 33 44 >"):
    message = read(text)
    print(f"{text} -> {message.dlc} bytes, {message.data.hex(' ')}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
