#!/bin/sh
# Peak resident memory of `linpred denoise` on large mirrored renders, as a table.
#
#   tests/memory/measure.sh render.exr folder [WIDTHxHEIGHT:LAYOUT ...]
#
# LAYOUT is one of mirror's: zip tiled parts piz dwaa. LINPRED_OPTIONS is passed on, e.g. "--max-memory 256M". The folder needs
# room for the largest file twice.
set -eu
render=$1 folder=$2
shift 2
[ $# -gt 0 ] || set -- 4096x4096:zip 4096x16384:zip 4096x65536:zip 16384x16384:zip 16384x16384:tiled \
    4096x4096:tiled 4096x4096:parts 4096x4096:piz 4096x4096:dwaa
target=${CARGO_TARGET_DIR:-target}/release
cargo build --quiet --release -p linpred -p linpred-tests --bin linpred --bin mirror
options="--quality fast ${LINPRED_OPTIONS:-}"
echo "| size | layout | planned | peak | seconds |"
echo "|---|---|---|---|---|"
for case; do
    size=${case%:*} layout=${case#*:}
    input=$folder/mirrored-$case.exr output=$folder/denoised-$case.exr
    [ -e "$input" ] || "$target/mirror" "$render" "$input" "${size%x*}" "${size#*x}" "$layout"
    # shellcheck disable=SC2086 # the options are words
    planned=$("$target/linpred" denoise $options "$input" -o "$output" --dry-run | sed -n 's/ *\(.*\)  in all/\1/p')
    # shellcheck disable=SC2086
    log=$("$target/linpred" denoise $options "$input" -o "$output" --log-format json 2>&1 | grep '"denoised"')
    field() { printf '%s\n' "$log" | sed "s/.*\"$1\":\([0-9.]*\).*/\1/"; }
    echo "| $size | $layout | $planned | $(($(field peak_bytes) >> 20)) MiB | $(field seconds) |"
    rm -f "$input" "$output"
done
