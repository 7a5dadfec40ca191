#!/usr/bin/env bash
# asc2log of can-utils 2020.11 (Debian 12): of an ASC file with names of messages, a frame is left out if its name can be read as a hexadecimal number.
#
# Needs apt-get and dpkg-deb of Debian 12. Nothing is installed.
# Source: asc2log.c tries a `CANFD` line without a name first, and says of a second try that it is for a line with a symbolic name. The first try takes
# a name such as `ADC` for the column of the bit rate switch, and so the name's neighbours for the length.
# Behaviour: the frames of a message `ADC`, `FEED` or `Cafe` are missing in the log, those of `Speed` are there. Nothing is printed, and the exit code is 0.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
apt-get download can-utils=2020.11.0-1 >/dev/null 2>&1 && dpkg-deb -x can-utils_*.deb x || exit 2

expected=$(cat <<'END'
Speed: 1 frame, exit code 0
ADC: 0 frames, exit code 0
Cafe: 0 frames, exit code 0
END
)
seen=$(for name in Speed ADC Cafe; do
    {
        printf 'date Wed Jun 3 10:00:00.000 am 2026\nbase hex  timestamps absolute\n'
        printf '   0.100000 CANFD   1 Rx        201  %-32s 0 0 3  3 3D 30 00   100000  214        0 80000000 46500250 460a0250 20011736 20010205\n' "$name"
    } >log.asc
    x/usr/bin/asc2log -I log.asc -O log 2>/dev/null
    code=$?
    frames=$(grep -c '201#' log)
    printf '%s: %s frame%s, exit code %s\n' "$name" "$frames" "$([ "$frames" = 1 ] || echo s)" "$code"
done)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
