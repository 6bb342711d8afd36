# Two commands do everything; both install what they need and say so.
#   make demo   build, simulate an insertion into the built-in phantom, write a report, show it live until Ctrl-C
#               (HEADLESS=1, or no terminal: end with the report)
#   make test   everything that CI runs
OUT ?= out/demo
CARGO_TARGET_DIR ?= target
export CARGO_TARGET_DIR

.PHONY: demo test build setup bench web

setup:
	@scripts/setup.sh

build: setup
	cargo build --release --locked

# The live view is built into the program where there is Node.js; without it a page says so.
web: setup
ifeq ($(HEADLESS),)
	@if command -v npm >/dev/null; then scripts/web.sh build; else echo "No Node.js 20: the program is built without the live view."; fi
endif

demo: web build
	@# Ctrl-C ends the live view as it should (status 130): no failure.
	@trap : INT; "$(CARGO_TARGET_DIR)/release/monro" demo --out "$(OUT)" --force $(if $(HEADLESS),--headless); \
	  status=$$?; [ $$status -eq 130 ] || exit $$status

bench: build
	scripts/bench.sh $(SCANS)

test: setup
	scripts/test.sh
