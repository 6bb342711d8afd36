#!/usr/bin/env bash
# Everything that CI runs, in the order in which faults are cheapest to find. One target directory for all of it.
set -euo pipefail
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-target}"
# From a clean clone nothing is built twice, so that keeping track of what was built gains nothing.
export CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-0}"

stage() { printf '\n== %s (%s s)\n' "$*" "$SECONDS"; }

stage "Python for the oracles: a virtual environment in $target/oracles"
scripts/oracles.sh setup "$target/oracles"

stage "Format"
cargo fmt --all --check

stage "Crate law, licences"
"$target/oracles/bin/python" scripts/check_crates.py

stage "Web app: packages, types, build (first, so that cargo builds once, with the app inside)"
scripts/web.sh setup
scripts/web.sh build

stage "Clippy, warnings are errors"
cargo clippy --workspace --all-targets --locked -- -D warnings

stage "Documentation, warnings are errors"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet

stage "Tests"
if command -v cargo-nextest >/dev/null; then
  cargo nextest run --workspace --locked --no-fail-fast
else
  cargo test --workspace --locked --no-fail-fast
fi

stage "Foreign oracles"
scripts/oracles.sh run "$target/oracles"

stage "Web app in the browser"
scripts/web.sh test

stage "Done"
# Tests on scans that are not in the repository pass without them.
if [ ! -d ../shared/data ]; then echo "Skipped: tests on real head CTs, as there is no ../shared/data."; fi
