#!/usr/bin/env bash
# log2asc of can-utils 2020.11 (Debian 12): a log whose times begin below one second becomes an ASC file with a header for each frame and all times 0.
#
# Needs apt-get and dpkg-deb of Debian 12. Nothing is installed.
# Source: log2asc.c takes the first time as the start while the start has 0 seconds. Programs with a clock of their own write logs that begin at 0.
# Behaviour: each frame up to second 1 is written behind a header of its own, at 0.000000. Its order in time is lost, and a reader that takes a header
# for a new part sees as many parts as frames.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
apt-get download can-utils=2020.11.0-1 >/dev/null 2>&1 && dpkg-deb -x can-utils_*.deb x || exit 2

expected=$(cat <<'END'
five: headers 1, times 0.000000 0.001000
zero: headers 2, times 0.000000 0.000000
END
)
printf '(%s.001000) can0 201#3D4000\n(%s.002000) can0 181#40810100\n' 0 0 >zero.log
printf '(%s.001000) can0 201#3D4000\n(%s.002000) can0 181#40810100\n' 5 5 >five.log
seen=$(for log in five zero; do
    x/usr/bin/log2asc -I $log.log can0 2>/dev/null | tr -d '\r' | awk -v log_=$log '/^base/ { headers++ } $2 == 1 { times = times " " $1 } END { print log_ ": headers " headers ", times" times }'
done)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
