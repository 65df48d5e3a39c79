#!/bin/sh
# Builds the command for AArch64, where the compiler makes NEON of the kernels, runs it under QEMU on the repository's sample, and compares what it writes with what
# this machine's writes, byte for byte. Not part of `.ci/run`: it compiles all kernels once more. Installs nothing; exits 3 and names what is missing.
set -eu
cd "$(dirname "$0")/../.."
target=aarch64-unknown-linux-gnu

missing=
need() { command -v "$1" >/dev/null || missing="$missing $2"; }
need qemu-aarch64-static qemu-user-static
need aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu
[ -e /usr/aarch64-linux-gnu/lib/libc.so.6 ] || missing="$missing libc6-dev-arm64-cross"
if [ -n "$missing" ]; then
    echo "missing Debian packages:$missing" >&2
    exit 3
fi
if [ ! -d "$(rustc --print sysroot)/lib/rustlib/$target" ]; then
    echo "missing: rustup target add $target" >&2
    exit 3
fi

export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
cargo build --quiet --release --locked --package linpred
cargo build --quiet --release --locked --package linpred --target "$target"
built=${CARGO_TARGET_DIR:-target}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# Denoises by the command `$3...` into `$out/$2.exr`; `$1` are options, cut at blanks.
denoise() {
    options=$1
    to=$out/$2.exr
    shift 2
    # shellcheck disable=SC2086
    if ! "$@" denoise $options -o "$to" tests/data/toasters_16spp.exr >"$out/log" 2>&1; then
        cat "$out/log" >&2
        exit 1
    fi
}
compare() {
    denoise "$1" here "$built/release/linpred"
    denoise "$1" there qemu-aarch64-static -L /usr/aarch64-linux-gnu "$built/$target/release/linpred"
    cmp "$out/here.exr" "$out/there.exr"
    echo "$1: the same bytes"
}
compare "--quality fast --error-layer"
compare "--quality high --models-layer --threads 1"
compare "--formulas wlr"
compare "--map half-a=none --map half-b=none --feature halfA"
