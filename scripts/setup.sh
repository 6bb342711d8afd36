#!/usr/bin/env bash
# Installs what building Monro needs and is missing: a C and C++ compiler (bundled sources of some crates).
# Rust itself is expected (https://rustup.rs). Says what it installs; does nothing when all is there.
set -euo pipefail

say() { printf '%s\n' "$*"; }

command -v cargo >/dev/null || { say "Monro needs Rust. Install it from https://rustup.rs, then run this again."; exit 1; }

missing=()
command -v cc >/dev/null || missing+=(gcc)
command -v c++ >/dev/null || missing+=(g++)
[ ${#missing[@]} -eq 0 ] && exit 0

if command -v apt-get >/dev/null; then
  sudo=""
  [ "$(id -u)" -eq 0 ] || sudo="sudo"
  say "Installing with apt-get: ${missing[*]}"
  $sudo apt-get update -qq
  $sudo apt-get install -y -qq --no-install-recommends "${missing[@]}"
else
  say "Please install: ${missing[*]} (no apt-get here to do it for you)."
  exit 1
fi
