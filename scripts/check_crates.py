"""Checks the tables of crates and of dependencies in ARCHITECTURE.md against `cargo metadata`, and the licences of all dependencies.

A crate of ours may depend only on those its row allows, dev-dependencies included
unless the row says `(tests)`; no cycles; `dicom-*` only in scan.
"""
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ALLOWED_LICENCES = {
    "MIT", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "Zlib", "ISC", "Unicode-3.0", "0BSD", "CC0-1.0", "Unlicense",
    "BSL-1.0", "IJG", "Apache-2.0 WITH LLVM-exception", "MIT-0",
}
ONLY_IN = {"dicom-": {"scan"}, "tokio": {"server"}, "axum": {"server"}, "nalgebra": {"guidance"}}


def law():
    text = (ROOT / "ARCHITECTURE.md").read_text()
    table = text.split("<!-- crate-law -->")[1].split("<!-- /crate-law -->")[0]
    rows = re.findall(r"^\| `(\w+)` \|[^|]*\|([^|]*)\|", table, re.M)
    return {name: set(re.findall(r"\w+(?: \(tests\))?", allowed)) for name, allowed in rows}


def dependencies():
    """Who uses each foreign dependency, as the table has it: {dependency: {"crate" or "crate (tests)"}}."""
    text = (ROOT / "ARCHITECTURE.md").read_text()
    table = text.split("<!-- dependencies -->")[1].split("<!-- /dependencies -->")[0]
    rows = re.findall(r"^\| (`[^|]*`) \|([^|]*)\|", table, re.M)
    users = [(names, set(re.findall(r"\w+(?: \(tests\))?", used_by))) for names, used_by in rows]
    return {name: used_by for names, used_by in users for name in re.findall(r"`([^`]+)`", names)}


def foreign(packages):
    """The same as it is. What a crate uses in its tests, too, is named once."""
    found = {}
    for package in packages:
        name = package["name"].removeprefix("monro-")
        for d in package["dependencies"]:
            if not d["name"].startswith("monro-"):
                found.setdefault(d["name"], {}).setdefault(name, set()).add(d["kind"] == "dev")
    return {d: {f"{n} (tests)" if kinds == {True} else n for n, kinds in users.items()} for d, users in found.items()}


def permitted(expression):
    """An SPDX expression is fine when every AND-part offers one allowed alternative."""
    parts = re.split(r"\s+AND\s+", expression.replace("/", " OR ").strip())
    return all(any(alt.strip(" ()") in ALLOWED_LICENCES for alt in re.split(r"\s+OR\s+", part)) for part in parts)


def main():
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", "x86_64-unknown-linux-gnu"]
    data = json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout)
    members = set(data["workspace_members"])
    rules, faults, seen = law(), [], set()
    for package in data["packages"]:
        if package["id"] not in members:
            if not permitted(package["license"] or ""):
                faults.append(f"{package['name']} {package['version']}: licence {package['license']!r} is not allowed")
            continue
        name = package["name"].removeprefix("monro-")
        seen.add(name)
        if name not in rules:
            faults.append(f"crate {name} has no row in ARCHITECTURE.md")
            continue
        for dependency, kind in {(d["name"], d["kind"]) for d in package["dependencies"]}:
            ours = dependency.removeprefix("monro-")
            in_tests = kind == "dev" and f"{ours} (tests)" in rules[name]
            if dependency.startswith("monro-") and ours not in rules[name] and not in_tests:
                faults.append(f"{name} depends on {ours}, which its row does not allow")
            for prefix, homes in ONLY_IN.items():
                if dependency.startswith(prefix) and name not in homes:
                    faults.append(f"{name} depends on {dependency}, whose only home is {', '.join(sorted(homes))}")
    faults += [f"ARCHITECTURE.md lists {name}, but there is no such crate" for name in rules.keys() - seen]
    faults += cycles(rules)
    told, there = dependencies(), foreign([p for p in data["packages"] if p["id"] in members])
    for name in sorted(told.keys() | there.keys()):
        if told.get(name) != there.get(name):
            faults.append(f"{name} is used by {sorted(there.get(name, []))}, in ARCHITECTURE.md by {sorted(told.get(name, []))}")
    for fault in faults:
        print(fault)
    print(f"crate law: {len(seen)} crates, {len(data['packages'])} packages, {len(faults)} faults")
    sys.exit(bool(faults))


def cycles(rules):
    """The table itself must be free of cycles; then what obeys it is too."""
    done, faults = set(), []

    def visit(name, path):
        if name in path:
            faults.append("cycle in the table: " + " -> ".join([*path[path.index(name):], name]))
        elif name not in done:
            for other in sorted(rules.get(name, ())):
                visit(other.removesuffix(" (tests)"), [*path, name])
            done.add(name)

    for name in sorted(rules):
        visit(name, [])
    return faults


if __name__ == "__main__":
    main()
