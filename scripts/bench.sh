#!/usr/bin/env bash
# Prints what README's table quotes: time and memory of preparing a scan and of inserting a catheter.
# Give scans as arguments to measure those as well as the built-in phantom.
set -euo pipefail
cd "$(dirname "$0")/.."
monro="${CARGO_TARGET_DIR:-target}/release/monro"
echo "== phantom"; "$monro" bench prepare
for scan in "$@"; do
  echo "== $scan"; "$monro" bench prepare "$scan"
done
