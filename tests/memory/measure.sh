#!/bin/sh
# Peak resident memory of `linpred denoise` on large mirrored renders, as a table. From the repository's root:
#
#   tests/memory/measure.sh render.exr folder [WIDTHxHEIGHT:LAYOUT ...]
#
# LAYOUT is one of mirror's: zip tiled parts piz dwaa. LINPRED_OPTIONS is passed on, e.g. "--max-memory 256M". The folder takes one case at a
# time: 7 GB for 16384 x 16384, input and output.
set -eu
render=$1 folder=$2
shift 2
[ $# -gt 0 ] || set -- 4096x4096:zip 4096x4096:tiled 4096x4096:parts 4096x4096:piz 4096x4096:dwaa 16384x2048:zip 16384x2048:tiled \
    4096x16384:zip 4096x65536:zip 16384x16384:zip 16384x16384:tiled
target=${CARGO_TARGET_DIR:-target}/release
cargo build --quiet --release -p linpred -p linpred-tests --bin linpred --bin mirror
# a build meanwhile does not change what is measured
cp "$target/linpred" "$target/mirror" "$folder"
options="--quality fast --threads 2 ${LINPRED_OPTIONS:-}"
field() { printf '%s\n' "$log" | sed -n "s/.*\"$1\":\([0-9.]*\).*/\1/p"; }
mebibytes() { awk -v bytes="$1" 'BEGIN { printf "%.1f MiB", bytes / 1048576 }'; }
echo "| size | layout | planned | peak | seconds |"
echo "|---|---|---|---|---|"
for case; do
    size=${case%:*} layout=${case#*:}
    input=$folder/mirrored-$case.exr output=$folder/denoised-$case.exr
    "$folder/mirror" "$render" "$input" "${size%x*}" "${size#*x}" "$layout"
    # shellcheck disable=SC2086 # the options are words
    planned=$("$folder/linpred" denoise $options "$input" -o "$output" --dry-run | sed -n 's/ *\(.*\)  in all/\1/p')
    # shellcheck disable=SC2086
    log=$("$folder/linpred" denoise $options "$input" -o "$output" --log-format json 2>&1) || printf '%s\n' "$log" >&2
    peak=$(field peak_bytes)
    echo "| ${size%x*} x ${size#*x} | $layout | $planned | $(mebibytes "$peak") | $(field seconds | cut -d. -f1) |"
    rm -f "$input" "$output"
done
rm "$folder/linpred" "$folder/mirror"
