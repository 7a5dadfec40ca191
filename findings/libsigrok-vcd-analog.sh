#!/usr/bin/env bash
# sigrok-cli 0.7.2 with libsigrok 0.5.2: a session with an analogue channel is written as a VCD file with lines that are no VCD.
#
# Needs sigrok-cli. Source: `sigrok-cli -L` lists the output format vcd, "Value Change Dump"; the session is recorded from the demo driver of libsigrok.
# Behaviour: behind the changes stand lines such as `A0: -10.00 V DC`, also with `-C D0,D1`. Without them (`grep -v ' V DC$'`) the file is a VCD.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
command -v sigrok-cli >/dev/null || exit 2
sigrok-cli -d demo --channels D0,D1,A0 --config samplerate=1m --samples 1000 -O srzip -o x.sr >/dev/null 2>&1 || exit 2

expected=$(cat <<'END'
all channels: lines that are no VCD
digital channels: lines that are no VCD
END
)
count() {
    case $(grep -c 'V DC' "$1") in
        0) echo none ;;
        *) echo 'lines that are no VCD' ;;
    esac
}
sigrok-cli -i x.sr -O vcd -o all.vcd >/dev/null 2>&1 || exit 2
sigrok-cli -i x.sr -C D0,D1 -O vcd -o digital.vcd >/dev/null 2>&1 || exit 2
seen=$(echo "all channels: $(count all.vcd)"; echo "digital channels: $(count digital.vcd)")
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
