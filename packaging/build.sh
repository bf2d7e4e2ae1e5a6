#!/usr/bin/env bash
# Makes what is shipped, into target/packages: packaging/build.sh [static | static-arm | deb] ...
#   static      slipbound-x86_64     one file, static (musl), for any x86-64 Linux
#   static-arm  slipbound-aarch64    the same for 64-bit ARM; linked by Rust's own linker, needs no cross compiler
#   deb         slipbound.deb        the first with manual pages, completions and a udev rule; needs dpkg-deb
# PROFILE=dev builds faster programs to be thrown away. Nothing is installed but Rust's own standard library for the target.
set -euo pipefail
cd "$(dirname "$0")/.."
out=target/packages
profile=${PROFILE:-release}

# Builds the program for a Rust target and puts it into target/packages.
static() {
    local target=$1 name=$2 variable said folder=$profile
    [ "$profile" = dev ] && folder=debug
    said=$(rustup target add "$target" 2>&1) || {
        echo "expected Rust's standard library for $target, got from \`rustup target add\`: $said" >&2
        exit 1
    }
    variable=CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$target")
    env "${variable}_LINKER=rust-lld" "${variable}_RUSTFLAGS=-C linker-flavor=ld.lld -C strip=symbols" \
        cargo build --profile "$profile" --locked -p slipbound-cli --target "$target"
    mkdir -p "$out"
    cp "${CARGO_TARGET_DIR:-target}/$target/$folder/slipbound" "$out/$name"
    ls -l "$out/$name"
}

deb() {
    # An older program would get the version of today.
    static x86_64-unknown-linux-musl slipbound-x86_64
    local tree=$out/deb program=$out/slipbound-x86_64 share version
    version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
    rm -rf "$tree"
    share=$tree/usr/share
    install -D -m 755 "$program" "$tree/usr/bin/slipbound"
    "$program" man -o "$share/man/man1"
    gzip -9n "$share"/man/man1/*
    install -d "$share/bash-completion/completions" "$share/zsh/vendor-completions" "$share/fish/vendor_completions.d"
    "$program" completions bash >"$share/bash-completion/completions/slipbound"
    "$program" completions zsh >"$share/zsh/vendor-completions/_slipbound"
    "$program" completions fish >"$share/fish/vendor_completions.d/slipbound.fish"
    install -D -m 644 packaging/60-slipbound.rules "$tree/usr/lib/udev/rules.d/60-slipbound.rules"
    install -D -m 644 LICENSE-MIT "$share/doc/slipbound/copyright"
    cat LICENSE-APACHE >>"$share/doc/slipbound/copyright"
    mkdir "$tree/DEBIAN"
    cat >"$tree/DEBIAN/control" <<CONTROL
Package: slipbound
Version: $version
Architecture: amd64
Section: science
Priority: optional
Maintainer: The slipbound authors <nobody@localhost>
Recommends: ffmpeg
Installed-Size: $(du -sk "$tree/usr" | cut -f1)
Description: incipient slip from a camera inside a soft fingertip
 Judges tactile recordings and cameras frame by frame and closes the loop to the grip force.
CONTROL
    dpkg-deb --root-owner-group --build "$tree" "$out/slipbound.deb"
    ls -l "$out/slipbound.deb"
}

for what in "${@:-static}"; do
    case $what in
    static) static x86_64-unknown-linux-musl slipbound-x86_64 ;;
    static-arm) static aarch64-unknown-linux-musl slipbound-aarch64 ;;
    deb) deb ;;
    *)
        echo "expected static, static-arm or deb, got $what" >&2
        exit 2
        ;;
    esac
done
