#!/usr/bin/env bash
# Builds every target into $OUT, each with its inputs and, where it takes bytes of the bus, the dictionary. $SANITIZER is the fuzzing
# service's; cargo-fuzz knows address, leak, memory and thread, and anything else is none of them. FUZZ_PROFILE=dev takes the quickly built programs.
set -euo pipefail
: "${OUT:?the folder for the results}"
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[[ -d fuzz ]] || cd "${SRC:?the folder with the sources}/drivebench"

sanitizer=${SANITIZER:-address}
case "$sanitizer" in address | leak | memory | thread) ;; *) sanitizer=none ;; esac
case "${FUZZ_PROFILE:-release}" in
    dev) profile=--dev folder=debug ;;
    *) profile=--release folder=release ;;
esac
host=$(rustc -vV | sed -n 's/^host: //p')
# All of them instrumented, unlike scripts/fuzz-build: a fuzzing service turns away what is not.
cargo fuzz build --sanitizer "$sanitizer" "$profile" --debug-assertions
mapfile -t with_dictionary < <(scripts/fuzz-targets --dictionary)
for target in $(scripts/fuzz-targets); do
    cp "fuzz/target/$host/$folder/$target" "$OUT/"
    seeds=$(mktemp -d)
    scripts/fuzz-seeds "$target" "$seeds"
    rm -f "$OUT/${target}_seed_corpus.zip"
    (cd "$seeds" && zip -q -r "$OUT/${target}_seed_corpus.zip" .)
    rm -rf "$seeds"
    if [[ " ${with_dictionary[*]} " == *" $target "* ]]; then cp fuzz/novobus.dict "$OUT/$target.dict"; fi
    # The other options, one a line, as a file of the fuzzing service's.
    scripts/fuzz-options "$target" | sed -n '/^-dict=/!s/^-\(.*\)=/\1 = /p' | sed '1i [libfuzzer]' >"$OUT/$target.options"
    [[ -s $OUT/$target.options ]] || rm "$OUT/$target.options"
done
