#!/usr/bin/env bash
# Foreign oracles: other people's programs read what ours write, and the other way round.
#   oracles.sh setup VENV   make the virtual environment
#   oracles.sh run VENV     build the dump tools and run every scripts/oracle_*.py
set -euo pipefail
cd "$(dirname "$0")/.."
action="$1" venv="$2"

setup() {
  command -v python3 >/dev/null || { echo "The oracle tests need python3; install it and run this again."; exit 1; }
  if ! python3 -c 'import ensurepip' 2>/dev/null; then
    sudo=""
    [ "$(id -u)" -eq 0 ] || sudo="sudo"
    echo "Installing with apt-get: python3-venv"
    $sudo apt-get update -qq && $sudo apt-get install -y -qq python3-venv
  fi
  if [ ! -e /usr/include/openigtlink/igtlMessageBase.h ] && apt-cache show libopenigtlink-dev >/dev/null 2>&1; then
    sudo=""
    [ "$(id -u)" -eq 0 ] || sudo="sudo"
    echo "Installing with apt-get: libopenigtlink-dev (without it, that oracle is skipped)"
    $sudo apt-get install -y -qq libopenigtlink-dev || echo "libopenigtlink-dev could not be installed; its oracle will be skipped."
  fi
  [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
  if ! cmp -s scripts/requirements.txt "$venv/requirements.txt"; then
    echo "Installing with pip into $venv: $(grep -v '^#' scripts/requirements.txt | tr '\n' ' ')"
    "$venv/bin/pip" install -q -r scripts/requirements.txt
    cp scripts/requirements.txt "$venv/requirements.txt"
  fi
}

run() {
  for script in scripts/oracle_*.py; do
    echo "-- $script"
    "$venv/bin/python" "$script"
  done
}

"$action"
