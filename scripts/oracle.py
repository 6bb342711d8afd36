"""What the oracle scripts share: our examples as programs, a free port, and a count of checks."""

import argparse
import os
import pathlib
import socket
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
_passed = _failed = 0


def example(name):
    """Path of an example of ours; the workspace is built as for the tests, so most of it is there already."""
    subprocess.run(["cargo", "build", "-q", "--locked", "--workspace", "--example", name], cwd=ROOT, check=True)
    return str(ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "debug" / "examples" / name)


def binary(about):
    """Path of the command: the one given by --monro, or that of the tests' build."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--monro")
    given = parser.parse_args().monro
    if given:
        return given
    subprocess.run(["cargo", "build", "-q", "--locked", "--workspace", "--bins"], cwd=ROOT, check=True)
    return str(ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "debug" / "monro")


def free_port():
    """A TCP port that nobody listens to."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def check(name, ok, detail=""):
    """Counts a check, and tells of one that failed."""
    global _passed, _failed
    if ok:
        _passed += 1
    else:
        _failed += 1
        print(f"FAILED {name} {detail}")


def finish():
    """Prints the count and ends the script."""
    print(f"{_passed} passed, {_failed} failed")
    raise SystemExit(1 if _failed else 0)
