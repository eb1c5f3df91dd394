#!/usr/bin/env python3
"""Compares `surfel bench` with a program on Embree that traces the same rays, and prints a table.

  compare.py SURFEL EMBREE_POINTS CLOUD.bin... [--rounds 7] [--surfaces disc,sphere]
  compare.py SURFEL EMBREE_TRIANGLES MESH.ply... [--rounds 7] [--surfaces triangle,triangle-robust]

Each file NAME.bin or NAME.ply needs a camera NAME.cam in its folder; each mesh needs NAME.tri, too, which holds
the mesh for Embree. Both programs run on one thread and on two. In each round every program runs once, in turn.
Rates are million rays a second: rays over the processor time of the process divided by its threads. For each
kind of ray Embree counts with the better of single rays and packets of 16, and for points with the better of its
own geometry and user geometry. The surface `triangle-robust` sets Embree's flag for robust scenes.

The table has the median rates of both programs over the rounds, the median of the ratios with their least and
greatest, and the ratio of the best rates. On a machine that is slowed down by others at times, the last column
shows what the ratio would be on a quiet one.
"""
import argparse, json, re, statistics, subprocess, sys
from pathlib import Path

KINDS = {"primary-isect": "primary", "shadow-occl": "shadow", "bounce-occl": "bounce-any",
         "bounce-isect": "bounce", "multi-1pass": "gather", "multi-2pass": "gather"}
TRIANGLES = {"triangle": [], "triangle-robust": ["--robust"]}
BUILD = "build, s"
THREADS = (1, 2)


def run(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


def embree_points(program, cloud, surface):
    """Returns the best rate over both set-ups of Embree, by number of threads and kind of ray."""
    camera = cloud.with_suffix(".cam").read_text().strip()
    rates = {}
    for mode in ["disc", "multi"] if surface == "disc" else [surface]:
        for setup in [[], ["--user"]]:
            text = run([program, cloud, mode, 1024, 1024, camera, "--runs", 1, "--k", "1,16", "--fast", *setup])
            for line in text.splitlines():
                name = line.split()[0] if line.split() else ""
                if name in KINDS and name.startswith("multi") == (mode == "multi"):
                    for threads in THREADS:
                        rate = float(re.search(rf"{threads}T best [\d.]+ median ([\d.]+)", line)[1])
                        key = threads, KINDS[name]
                        rates[key] = max(rates.get(key, 0.0), rate)
    for threads in THREADS:
        builds = []
        for setup in [[], ["--user"]]:
            command = [program, cloud, surface, 64, 64, camera, "--runs", 0, *setup]
            text = run([*command, "--cfg", f"threads={threads}"])
            builds.append(float(re.search(r"build  min ([\d.]+) s", text)[1]))
        rates[threads, BUILD] = min(builds)
    return rates


def embree_triangles(program, mesh, surface):
    files = [mesh.with_suffix(".tri"), mesh.with_suffix(".cam")]
    return by_threads([program, *files, *TRIANGLES[surface]])


def surfel(program, file, surface):
    command = [program, "bench", file, "--camera-file", file.with_suffix(".cam"), "--json"]
    return by_threads(command if surface in TRIANGLES else [*command, "--surface", surface])


def by_threads(command):
    """Returns the rates that a program prints as JSON, by number of threads and kind of ray."""
    rates = {}
    for threads in THREADS:
        result = json.loads(run([*command, "--threads", threads, "--runs", 1]))
        for kind, row in result["rays"].items():
            rates[threads, kind] = row["median_mrays_per_s"]
        rates[threads, BUILD] = result["build_s"]
    return rates


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("surfel")
    parser.add_argument("embree")
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--surfaces")
    args = parser.parse_args()
    print("| file | surface | threads | rays | surfel | Embree | ratio | ratio of the best |\n|---|---|---|---|---|---|---|---|")
    for file in args.files:
        usual = "disc,sphere" if file.suffix == ".bin" else "triangle,triangle-robust"
        for surface in (args.surfaces or usual).split(","):
            compare(args, file, surface)


def compare(args, file, surface):
    embree = embree_triangles if surface in TRIANGLES else embree_points
    ours, theirs = {}, {}
    for _ in range(args.rounds):
        add(ours, surfel(args.surfel, file, surface))
        add(theirs, embree(args.embree, file, surface))
    for threads, kind in sorted(ours):
        found, other = ours[threads, kind], theirs[threads, kind]
        ratios = [b / a if kind == BUILD else a / b for a, b in zip(found, other)]
        median = statistics.median
        best = min(other) / min(found) if kind == BUILD else max(found) / max(other)
        print(f"| {file.stem} | {surface} | {threads} | {kind} | {median(found):.3g} | {median(other):.3g} "
              f"| {median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f}) | {best:.2f} |", flush=True)


def add(rounds_rates, rates):
    for key, rate in rates.items():
        rounds_rates.setdefault(key, []).append(rate)


if __name__ == "__main__":
    main()
