#!/usr/bin/env bash
# dbc-codegen 0.4.0: a signal that is a multiplexer inside another has no variant in the generated code, so frames that it selects cannot be read. The build succeeds.
#
# Needs cargo. Source: the README says that messages of a DBC file become Rust types; nothing says that a nested multiplexer is left out.
# Behaviour: for `READ m61M` the generated enum of REGID has no arm 61; INTERVAL, which READ selects, is an arm 0 of REGID. With `READ m61` and `INTERVAL m61` there is an arm 61.
# Seen: the lines below `expected`.
set -u
dir=$(mktemp -d) && cd "$dir" || exit 2
trap 'rm -rf "$dir"' EXIT
mkdir -p gen/src && cd gen || exit 2
cat >Cargo.toml <<'END'
[package]
name = "gen"
version = "0.1.0"
edition = "2021"
[dependencies]
dbc-codegen = "=0.4.0"
END
cat >src/main.rs <<'END'
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    dbc_codegen::Config::builder().dbc_name("x.dbc").dbc_content(&text).build().write_to_file(format!("{path}.rs")).unwrap();
}
END
cargo build --quiet 2>/dev/null || exit 2

dbc() {
    printf 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: A B\n\nBO_ 513 Rx: 5 A\n SG_ REGID M : 0|8@1+ (1,0) [0|255] "" B\n'
    printf ' SG_ READ m61%s : 8|8@1+ (1,0) [0|255] "" B\n SG_ INTERVAL %s : 16|8@1+ (1,0) [0|255] "" B\n' "$1" "$2"
    printf ' SG_ SPEED m49 : 8|16@1- (1,0) [0|0] "" B\n'
}
dbc M m0 >nested.dbc
dbc '' m61 >flat.dbc
expected=$(cat <<'END'
nested: exit 0, arms 0 49
flat: exit 0, arms 49 61
END
)
seen=$(for kind in nested flat; do
    target/debug/gen $kind.dbc >/dev/null 2>&1
    code=$?
    echo "$kind: exit $code, arms $(sed -n 's/^ *\([0-9]*\) => Ok(RxRegidIndex.*/\1/p' $kind.dbc.rs | tr '\n' ' ' | sed 's/ $//')"
done)
printf '%s\n' "$seen"
[ "$seen" = "$expected" ] || exit 1
