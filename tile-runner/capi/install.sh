#!/usr/bin/env bash
# Installs the C interface: install.sh PREFIX [BUILT]. Headers, both libraries, linpred.pc and the CMake package go below PREFIX, which can be moved as a
# whole afterwards. BUILT is a folder with libraries that cargo made; without it a release is built.
set -euo pipefail

if [ $# -lt 1 ] || [ $# -gt 2 ]; then
    echo "usage: $0 PREFIX [BUILT]" >&2
    exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)
prefix=$1
built=${2:-}
if [ -z "$built" ]; then
    cargo build --release --locked --manifest-path "$here/Cargo.toml"
    built=${CARGO_TARGET_DIR:-$here/../../target}/release
fi

version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/../../Cargo.toml" | head -n 1)
# What the static library needs beside itself: see `rustc --print native-static-libs`.
case $(uname -s) in
Darwin)
    shared=liblinpred_c.dylib soname=@rpath/liblinpred_c.dylib system="-lSystem -lm"
    ;;
*)
    shared=liblinpred_c.so.$version soname=liblinpred_c.so.0 system="-lgcc_s -lpthread -lm -ldl"
    ;;
esac

install -d "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/lib/cmake/linpred"
install -m 644 "$here/include/linpred.h" "$here/include/linpred.hpp" "$prefix/include"
install -m 644 "$built/liblinpred_c.a" "$prefix/lib"
install -m 755 "$built/${shared%".$version"}" "$prefix/lib/$shared"
if [ "$soname" = liblinpred_c.so.0 ]; then
    ln -sf "$shared" "$prefix/lib/$soname"
    ln -sf "$soname" "$prefix/lib/liblinpred_c.so"
fi

fill() {
    sed -e "s|@VERSION@|$version|" -e "s|@SHARED_LIBRARY@|$shared|" -e "s|@SONAME@|$soname|" \
        -e "s|@SYSTEM_LIBRARIES@|$2|" "$here/pkg/$1.in"
}
fill linpred.pc "$system" >"$prefix/lib/pkgconfig/linpred.pc"
# CMake's list of libraries
fill linpredConfig.cmake "${system// /;}" >"$prefix/lib/cmake/linpred/linpredConfig.cmake"
fill linpredConfigVersion.cmake "" >"$prefix/lib/cmake/linpred/linpredConfigVersion.cmake"
