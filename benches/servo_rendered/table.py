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

print("| scene, features |", " | ".join(NAMES), "| cm, median | °, median | ms a step, median |")
print("|---|" + "---:|" * (len(NAMES) + 3))
for (scene, front), methods in cells.items():
    # All of a method's runs: the starts of a method with fewer of them are among the others'.
    arrived = {m: sum(r["outcome"] == "arrived" for r in runs.values()) for m, runs in methods.items()}
    counts = [f"{arrived[m]} of {len(methods[m])}" if m in methods else "–" for m in NAMES]
    ours = list(methods.get("servo", {}).values())
    medians = [f"{np.median([r[key] for r in ours]):.2f}" if ours else "–" for key in ("cm", "deg", "ms")]
    print(f"| {scene}, {front} |", " | ".join(counts + medians), "|")
print()
for (scene, front), methods in cells.items():
    for name, runs in methods.items():
        lost = {s: r for s, r in runs.items() if r["outcome"] != "arrived"}
        if lost:
            words = Counter(r["outcome"] for r in lost.values())
            print(f"{scene}, {front}, {name}:", ", ".join(f"{n} {w}" for w, n in words.items()), "starts", sorted(lost))
