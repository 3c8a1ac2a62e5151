"""Runs as a table, and the causes of losses: python table.py RUNS.jsonl"""

import json
import sys
from collections import Counter, defaultdict

import numpy as np

NAMES = ("servo", "poselib", "homography", "ibvs")

cells = defaultdict(dict)
for line in open(sys.argv[1]):
    run = json.loads(line)
    cells[run["scene"], run["front"]].setdefault(run["method"], {})[run["start"]] = run

print("| scene, features | starts |", " | ".join(NAMES), "| cm, median | ms a step, median |")
print("|---|---:|" + "---:|" * (len(NAMES) + 2))
for (scene, front), methods in cells.items():
    starts = set.intersection(*(set(runs) for runs in methods.values()))
    counts = [
        f"{sum(methods[m][s]['outcome'] == 'arrived' for s in starts)}" if m in methods else "–" for m in NAMES
    ]
    ours = [methods["servo"][s] for s in starts if "servo" in methods]
    cm = f"{np.median([r['cm'] for r in ours]):.2f}" if ours else "–"
    ms = f"{np.median([r['ms'] for r in ours]):.2f}" if ours else "–"
    print(f"| {scene}, {front} | {len(starts)} |", " | ".join(counts), f"| {cm} | {ms} |")
print()
for (scene, front), methods in cells.items():
    for name, runs in methods.items():
        lost = {s: r for s, r in runs.items() if r["outcome"] != "arrived"}
        if lost:
            words = Counter(r["outcome"] for r in lost.values())
            print(f"{scene}, {front}, {name}:", ", ".join(f"{n} {w}" for w, n in words.items()), "starts", sorted(lost))
