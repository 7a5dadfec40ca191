#!/usr/bin/env bash
# slcand of can-utils 2020.11 (Debian 12): an absolute path that is not below /dev is looked for below /dev.
#
# Needs apt-get and dpkg-deb of Debian 12. Nothing is installed.
# Source: `slcand -h`: `slcand [options] <tty> [canif-name]`. slcand.c puts "/dev/" in front of a name that does not begin with it.
# Behaviour: a link to a pseudo terminal, such as socat, tty0tty and simulators make (/tmp/port), is not found. `slcand "$(readlink -f /tmp/port)"` is,
# since it begins with /dev/pts.
# Seen: the lines below `expected`, for a link that leads to a terminal, and for the terminal itself.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
apt-get download can-utils=2020.11.0-1 >/dev/null 2>&1 && dpkg-deb -x can-utils_*.deb x || exit 2

expected=$(cat <<'END'
link: /dev//PATH/port: No such file or directory
terminal: found
END
)
seen=$(python3 - <<'END'
import os
import pty
import subprocess

_, there = pty.openpty()
os.symlink(os.ttyname(there), "port")
link = os.path.abspath("port")
for name, path in ("link", link), ("terminal", os.path.realpath(link)):
    words = ["x/usr/bin/slcand", "-F", "-o", "-s6", path, "can9"]
    slcand = subprocess.run(words, capture_output=True, text=True, timeout=20)
    missing = {line for line in slcand.stderr.splitlines() if "No such file" in line}
    print(f"{name}: {', '.join(missing).replace(link, '/PATH/port') or 'found'}")
END
)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
