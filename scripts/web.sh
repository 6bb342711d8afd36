#!/usr/bin/env bash
# The web app. Monro builds and runs without it; with it, the server shows the live view.
#   web.sh setup   install what is missing: Node packages (from the lock file), Chromium for the tests
#   web.sh build   check the types and build web/dist, which the next cargo build puts into the binary
#   web.sh test    build the app and the server, and try both in a headless browser
#   web.sh fps CASE [SECONDS]   frames a second of the live page of a case; GPU=1 draws on the graphics card
# SHOTS=DIR keeps screenshots of the test.
set -euo pipefail
cd "$(dirname "$0")/.."
target="${CARGO_TARGET_DIR:-target}"

need_node() {
  command -v npm >/dev/null || { echo "The web app needs Node.js 20 or newer with npm; install it (https://nodejs.org) and run this again."; exit 1; }
}

packages() {
  need_node
  if ! cmp -s web/package-lock.json web/node_modules/.monro-lock; then
    echo "Installing with npm into web/node_modules: $(node -p 'const p = require("./web/package.json"); Object.keys({ ...p.dependencies, ...p.devDependencies }).join(" ")')"
    npm ci --prefix web --no-audit --no-fund --loglevel=error
    cp web/package-lock.json web/node_modules/.monro-lock
  fi
}

browser() {
  [ -x "${CHROMIUM:-/usr/bin/chromium}" ] && return
  command -v apt-get >/dev/null || { echo "The web tests need Chromium; install it and set CHROMIUM to its path."; exit 1; }
  sudo=""
  [ "$(id -u)" -eq 0 ] || sudo="sudo"
  echo "Installing with apt-get: chromium"
  $sudo apt-get update -qq && $sudo apt-get install -y -qq --no-install-recommends chromium
}

setup() {
  packages
  browser
}

# A hash of all that the app is built from.
inputs() {
  find web -type d \( -name node_modules -o -name dist -o -name tests \) -prune -o -type f -print0 | sort -z | xargs -0 sha256sum | sha256sum
}

# Only what has changed: a newer web/dist has Cargo compile the server and the program again.
build() {
  packages
  local built=web/node_modules/.monro-built
  if [ -f web/dist/index.html ] && [ "$(inputs)" = "$(cat "$built" 2>/dev/null)" ]; then
    echo "The web app is built already."
    return
  fi
  npm run --silent --prefix web build
  inputs > "$built"
}

test() {
  build
  browser
  # The whole workspace, so that features and hence dependencies are those of the tests, built already.
  cargo build --locked --workspace --bins --example serve_ellipsoid --example deformed_slice
  node web/tests/run.mjs "$target/debug/examples/serve_ellipsoid"
  node web/tests/edit.mjs "$target/debug/monro"
  # A real head too, where there is one.
  local scan=../shared/data/head-ct-2mm/head_ct.mha
  if [[ -f "$scan" ]]; then node web/tests/edit.mjs "$target/debug/monro" "$scan"; fi
}

fps() {
  build
  browser
  cargo build --locked --release
  node web/tests/fps.mjs "$target/release/monro" "${1:?give a case}" "${2:-10}"
}

"${1:?say setup, build, test or fps}" "${@:2}"
