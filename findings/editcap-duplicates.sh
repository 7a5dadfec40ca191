#!/usr/bin/env bash
# editcap of Wireshark 4.0: `-d` takes packets of different interfaces for duplicates, so equal octets that pass two links of a serial ring are removed.
#
# Needs editcap (package wireshark-common). The version is printed; 4.0.17 was seen.
# Source: editcap(1): "-d: Attempts to remove duplicate packets. The length and MD5 hash of the current packet are compared to the previous four (4) packets".
# The interface of a packet is not compared, nor is its time: an octet that each of three stations passes on is one packet afterwards.
# Behaviour: of six octets, two on each of three interfaces with a millisecond between them, two are left.
# Seen: the line below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
command -v editcap >/dev/null && command -v python3 >/dev/null || exit 2
editcap --version 2>/dev/null | head -n 1

python3 - <<'END' || exit 2
import struct

def block(kind, body):
    body += bytes(-len(body) % 4)
    return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)

with open("ring.pcapng", "wb") as out:
    out.write(block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)))
    for _ in range(3):
        out.write(block(1, struct.pack("<HHI", 147, 0, 0)))
    for octet in (0x88, 0xFE):
        for link in range(3):
            at = octet * 10_000 + link * 1_000
            out.write(block(6, struct.pack("<IIIII", link, 0, at, 1, 1) + bytes([octet])))
END
expected='6 packets, 2 left'
editcap -d ring.pcapng less.pcapng >said 2>&1 || exit 2
removed=$(sed -n 's/^\([0-9]*\) packets seen, \([0-9]*\) packets skipped.*/\1 \2/p' said)
seen=$(echo "$removed" | awk '{ print $1 " packets, " $1 - $2 " left" }')
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
