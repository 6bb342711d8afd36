#!/usr/bin/env bash
# Coverage-guided fuzzing of every decoder, each for SECONDS (default 600); prints the number of executions.
#   fuzz.sh [SECONDS] [TARGET...]
# Needs a nightly compiler and cargo-fuzz, and installs what is missing. Found inputs stay in fuzz/corpus and fuzz/artifacts.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds="${1:-600}"
shift || true
targets=("$@")
[ "${#targets[@]}" -gt 0 ] || targets=(openigtlink_message openigtlink_stream natnet_frame natnet_conversation recording session_log)

rustup toolchain list | grep -q nightly || { echo "Installing with rustup: nightly"; rustup toolchain install nightly --profile minimal; }
command -v cargo-fuzz >/dev/null || { echo "Installing with cargo: cargo-fuzz"; cargo +nightly install --locked cargo-fuzz; }
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}/fuzz"

cargo +nightly run --quiet --manifest-path fuzz/Cargo.toml --bin seeds -- fuzz
for target in "${targets[@]}"; do
  cargo +nightly fuzz build "$target" 2>/dev/null || cargo +nightly fuzz build "$target"
  # Inputs of up to 64 KiB; a decoder that allocates more than the limit is a find.
  log="$(cargo +nightly fuzz run "$target" -- -max_total_time="$seconds" -max_len=65536 -rss_limit_mb=1024 -malloc_limit_mb=256 -print_final_stats=1 2>&1)" || { echo "$log"; exit 1; }
  echo "$target: $(grep -o 'number_of_executed_units: [0-9]*' <<<"$log" | grep -o '[0-9]*') executions in $seconds s, clean"
done
