#!/bin/sh
# Builds for a Cortex-M7: every_function and every_cell, which only have to link, and tile, which runs under QEMU. Installs nothing; exits 3 and names the Debian packages if a tool is
# missing. CARGO_TARGET_DIR, if set, is where it builds.
set -eu
cd "$(dirname "$0")"

missing=
need() { [ -e "$1" ] || missing="$missing $2"; }
need /usr/bin/rustc rustc-web
need /usr/lib/rustlib/src/rust/library/core/src/lib.rs rust-web-src
need /usr/bin/cargo cargo-web
need /usr/bin/ld.lld lld
need /usr/bin/qemu-system-arm qemu-system-arm
if [ -n "$missing" ]; then
    echo "missing Debian packages:$missing" >&2
    exit 3
fi

# Debian's compiler, because it comes with the library's source: core is built for the target, which -Zbuild-std makes a nightly feature.
# The workspace may ask for a newer compiler than Debian's; the core's code does not.
env -u RUSTUP_TOOLCHAIN -u RUSTFLAGS RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc /usr/bin/cargo build --release --locked --quiet \
    --ignore-rust-version -Zbuild-std=core --target thumbv7em-none-eabihf

timeout 120 qemu-system-arm -machine mps2-an500 -cpu cortex-m7 -display none -monitor none -serial none -icount shift=0 \
    -chardev stdio,id=terminal -semihosting-config enable=on,target=native,chardev=terminal \
    -kernel "${CARGO_TARGET_DIR:-target}/thumbv7em-none-eabihf/release/tile"
