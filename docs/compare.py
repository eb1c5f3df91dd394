#!/usr/bin/env python3
"""Runs `surfel bench` and the Embree point benchmark in turn and prints the ratios as a table.

  compare.py SURFEL EMBREE_POINTS CLOUDS... [--rounds 3] [--threads 1,2] [--surfaces disc,sphere]

CLOUDS are NAME.bin with NAME.cam beside. Both programs trace the same rays; rates are million rays a
second of processor time over threads, the median of seven runs. Embree counts with the better of its two
set-ups for each kind of ray. A ratio is the median over the rounds; in brackets its least and greatest.
"""
import argparse, json, re, statistics, subprocess
from pathlib import Path

KINDS = {"primary-isect": "primary", "shadow-occl": "shadow", "bounce-occl": "bounce-any",
         "bounce-isect": "bounce", "multi-1pass": "gather", "multi-2pass": "gather"}


def run(command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def embree(program, cloud, mode, threads):
    """Best rate of each kind over both set-ups, and the best build seconds."""
    camera = cloud.with_suffix(".cam").read_text().strip()
    rates, build = {}, float("inf")
    for setup in [[], ["--user"]]:
        text = run([program, cloud, mode, 1024, 1024, camera, "--cfg", f"threads={threads}", *setup])
        build = min(build, float(re.search(r"build  min ([\d.]+) s", text)[1]))
        for line in text.splitlines():
            name = line.split()[0] if line.split() else ""
            if name in KINDS and (name.startswith("multi") == (mode == "multi")):
                found = re.search(rf"{threads}T best [\d.]+ median ([\d.]+)", line)
                kind = KINDS[name]
                rates[kind] = max(rates.get(kind, 0.0), float(found[1]))
    return rates, build


def surfel(program, cloud, surface, threads):
    command = [program, "bench", cloud, "--camera-file", cloud.with_suffix(".cam"), "--surface", surface]
    result = json.loads(run([*command, "--threads", threads, "--json"]))
    rates = {kind: row["median_mrays_per_s"] for kind, row in result["rays"].items()}
    return rates, result["build_s"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("surfel")
    parser.add_argument("embree")
    parser.add_argument("clouds", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--surfaces", default="disc,sphere")
    args = parser.parse_args()
    print("| cloud | surface | threads | rays | surfel | Embree | ratio |\n|---|---|---|---|---|---|---|")
    for cloud in args.clouds:
        for surface in args.surfaces.split(","):
            for threads in map(int, args.threads.split(",")):
                compare(args, cloud, surface, threads)


def compare(args, cloud, surface, threads):
    ours, theirs = {}, {}
    for _ in range(args.rounds):
        rates, build = surfel(args.surfel, cloud, surface, threads)
        rates["build, s"] = build
        other, build = embree(args.embree, cloud, surface, threads)
        if surface == "disc":
            other |= {"gather": embree(args.embree, cloud, "multi", threads)[0]["gather"]}
        other["build, s"] = build
        for kind in rates:
            ours.setdefault(kind, []).append(rates[kind])
            theirs.setdefault(kind, []).append(other[kind])
    for kind in ours:
        ratios = [a / b for a, b in zip(ours[kind], theirs[kind])]
        if kind == "build, s":
            ratios = [1 / ratio for ratio in ratios]
        middle = statistics.median
        print(f"| {cloud.stem} | {surface} | {threads} | {kind} | {middle(ours[kind]):.3g} | {middle(theirs[kind]):.3g} "
              f"| {middle(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f}) |", flush=True)


if __name__ == "__main__":
    main()
