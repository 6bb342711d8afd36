#!/usr/bin/env python3
"""Runs other soft-body engines and ours in turn on the same meshes and the same scene, and prints ratios.

    scripts/bench_peers.py PEERS_FOLDER [--peers jolt,rapier-edge_volume-10x1] [--meshes 5824,37336,65691] [--repeat 3]

PEERS_FOLDER holds the peers' `run.py`, which prints one JSON line for each peer and mesh, and beside it `meshes/` with the
meshes (`ball_N.vtu`, metres). Equal work: edges and volumes, ten iterations in a frame of 1/60 s. Ours must be built
(`cargo build --release -p monro-cli`); the peers build by themselves, into PEERS_TARGET_DIR where that is set. Each repeat
runs everything in turn, and the least median of all repeats counts, so that other work on the machine hurts least. Not
part of CI: it needs the peers, a quiet machine and minutes.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
def ours(monro, mesh):
    command = [monro, "bench", "frame", "--mesh", str(mesh), "--scale", "1000", "--constraints", "edges,volumes", "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr}")
    return json.loads(done.stdout)


def theirs(folder, peers, mesh):
    environment = dict(os.environ)
    if "PEERS_TARGET_DIR" in environment:
        environment["CARGO_TARGET_DIR"] = environment["PEERS_TARGET_DIR"]
    command = [sys.executable, "run.py", "--peers", peers, "--meshes", mesh]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    records = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if not records:
        sys.exit(f"{' '.join(command)} in {folder} printed no record:\n{done.stderr}")
    for r in records:
        if "skipped" in r:
            print(f"{r['peer']} on {mesh}: skipped, {r['skipped']}", file=sys.stderr)
    return [r for r in records if "ms_median" in r]


def keep_least(best, name, record):
    if name not in best or record["ms_median"] < best[name]["ms_median"]:
        best[name] = record


def signs(record):
    end = record.get("signs", {}).get("end", record)
    inverted = end.get("inverted_share", end.get("inverted"))
    return f"inverted {100 * inverted:.3f} %, volume {100 * end['volume_change']:+.2f} %" if inverted is not None else ""


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("folder", type=pathlib.Path, help="the folder of the peers' run.py")
    a.add_argument("--peers", default="jolt-xpbd-1x10,rapier-edge_volume-10x1")
    a.add_argument("--meshes", default="5824,37336,65691")
    a.add_argument("--repeat", type=int, default=3)
    target = os.environ.get("CARGO_TARGET_DIR", ROOT / "target")
    a.add_argument("--monro", default=pathlib.Path(target) / "release" / "monro")
    args = a.parse_args()
    for mesh in args.meshes.split(","):
        best = {}
        for _ in range(args.repeat):
            for record in theirs(args.folder, args.peers, mesh):
                keep_least(best, record["peer"], record)
            own = ours(args.monro, args.folder.parent / "meshes" / f"ball_{mesh}.vtu")
            keep_least(best, "ours", own)
            keep_least(best, "ours, predicted space", own["predicted"])
        print(f"ball_{mesh}: median of a frame, and how many times ours it takes")
        for name, r in sorted(best.items(), key=lambda item: item[1]["ms_median"]):
            ratio = r["ms_median"] / best["ours"]["ms_median"]
            print(f"  {name:28} {r['ms_median']:8.3f} ms  p99 {r['ms_p99']:8.3f}  CPU {r['cpu_ms_median']:8.3f}  "
                  f"{ratio:6.2f}  {signs(r)}")


if __name__ == "__main__":
    main()
