#!/usr/bin/env bash
# Builds every target into $OUT, each with its inputs and, where it takes bytes of the bus, the dictionary.
set -euo pipefail
: "${OUT:?the folder for the results}"
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[[ -d fuzz ]] || cd "$SRC/drivebench"

(cd fuzz && cargo fuzz build --release --debug-assertions)
built=fuzz/target/x86_64-unknown-linux-gnu/release
for target in bus_end codec detector links ring drive master guard scenario rig capture record; do
    cp "$built/$target" "$OUT/"
    seeds=$(mktemp -d)
    for file in corpora/fuzz/"$target"/*; do
        name=$(basename "$file")
        if [[ $name == *.hex ]]; then
            sed 's/#.*//' "$file" | tr -dc '0-9A-Fa-f' | sed 's/../\\x&/g' | xargs -0 printf '%b' >"$seeds/${name%.hex}"
        else
            cp "$file" "$seeds/$name"
        fi
    done
    (cd "$seeds" && zip -q -r "$OUT/${target}_seed_corpus.zip" .)
    rm -rf "$seeds"
    case "$target" in bus_end | codec | detector | ring | guard) cp fuzz/novobus.dict "$OUT/$target.dict" ;; esac
done
