# Two commands do everything; both install what they need and say so.
#   make demo   build, simulate an insertion into the built-in phantom, write a report, say where to look
#   make test   everything that CI runs
OUT ?= out/demo
CARGO_TARGET_DIR ?= target
export CARGO_TARGET_DIR

.PHONY: demo test build setup bench

setup:
	@scripts/setup.sh

build: setup
	cargo build --release --locked

demo: build
	"$(CARGO_TARGET_DIR)/release/monro" demo --out "$(OUT)" --force

bench: build
	scripts/bench.sh $(SCANS)

test: setup
	scripts/test.sh
