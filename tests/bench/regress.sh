#!/bin/sh
# Counts the instructions of the core's kernels under callgrind and compares them with kernels.baseline.
#
#   tests/bench/regress.sh           fails if a kernel takes 3 % more or less than its baseline
#   tests/bench/regress.sh --bless   writes the baseline anew
#
# Counts depend on the compiler: the baseline names its rustc. Without valgrind nothing is counted, and it says so.
set -eu
cd "$(dirname "$0")"
baseline=kernels.baseline
if ! command -v valgrind >/dev/null; then
    echo "regress.sh: NOT TESTED, valgrind is not installed: no instruction was counted"
    exit 0
fi
cargo build --quiet --release -p linpred-kernels
kernels="${CARGO_TARGET_DIR:-../../target}/release/kernels"
counts=$(mktemp)
trap 'rm -f "$counts"' EXIT
for kernel in denoise_cells prefilter weigh_samples; do
    said=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null --collect-atstart=no '--toggle-collect=*counted*' \
        "$kernels" "$kernel" 2>&1)
    count=$(printf '%s\n' "$said" | sed -n 's/.*Collected *: *//p')
    if [ -z "$count" ] || [ "$count" -lt 1000 ]; then
        printf '%s\n' "$said" >&2
        echo "regress.sh: callgrind counted nothing in $kernel" >&2
        exit 2
    fi
    echo "$kernel $count" >>"$counts"
done
if [ "${1:-}" = --bless ]; then
    { echo "# $(rustc --version), $(rustc -vV | sed -n 's/^host: //p')"; cat "$counts"; } >"$baseline"
    cat "$baseline"
    exit 0
fi
echo "baseline: $(head -n 1 "$baseline")"
echo "now:      # $(rustc --version), $(rustc -vV | sed -n 's/^host: //p')"
if [ "$(head -n 1 "$baseline")" != "# $(rustc --version), $(rustc -vV | sed -n 's/^host: //p')" ]; then
    cat "$counts"
    echo "regress.sh: NOT TESTED, the baseline is another compiler's"
    exit 0
fi
awk '
    FNR == NR { if ($1 != "#") expected[$1] = $2; next }
    {
        if (!($1 in expected)) { print $1, "has no baseline"; bad = 1; next }
        ratio = $2 / expected[$1]
        verdict = "ok"
        if (ratio > 1.03) { verdict = "SLOWER"; bad = 1 }
        if (ratio < 0.97) { verdict = "faster: bless the new baseline"; bad = 1 }
        printf "%-13s %12d, baseline %12d: %+.2f %% %s\n", $1, $2, expected[$1], 100 * (ratio - 1), verdict
    }
    END { exit bad }
' "$baseline" "$counts"
