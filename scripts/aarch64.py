"""Compares the answers of two processors to the same pairs, for scripts/aarch64; an error where they are not the same."""

import json
import math
import pathlib
import sys

FROM_SLOW_TO_FAST = ["portable", "sse2", "avx2", "avx512"]
LARGEST_ANGLE = 1e-9  # degrees
folder = pathlib.Path(sys.argv[1])


def read(name):
    records = [json.loads(line) for line in (folder / f"{name}.jsonl").read_text().splitlines()]
    return {record["name"]: record for record in records}


# Angles are taken from distances, which keep their digits where a cosine has lost them.
def rotation_angle(a, b):
    entries = [[x for row in record["R_21"] for x in row] for record in (a, b)]
    return math.degrees(math.dist(*entries) / math.sqrt(2))


def direction_angle(a, b):
    units = [[x / math.hypot(*record["t_21"]) for x in record["t_21"]] for record in (a, b)]
    return math.degrees(math.dist(*units))


def compare(name, other):
    """Prints a row of the table, and the pairs that differ; gives whether there are none."""
    found, expected = read(name), read(other)
    assert found.keys() == expected.keys(), f"{name} and {other} hold other pairs"
    couples = [(found[pair], expected[pair]) for pair in found]
    counts = [sum(a.get(key) == b.get(key) for a, b in couples) for key in ("model", "inliers", "iterations")]
    posed = [(a, b) for a, b in couples if "R_21" in a and "R_21" in b]
    rotation = max(rotation_angle(a, b) for a, b in posed)
    direction = max(direction_angle(a, b) for a, b in posed)
    print(f"| {name} | {other} | {' | '.join(map(str, counts))} | {rotation:.1e}° | {direction:.1e}° |")
    for pair in found:
        differ = [key for key in ("model", "inliers", "iterations") if found[pair].get(key) != expected[pair].get(key)]
        if differ:
            print(f"  {pair}: {', '.join(differ)}")
    return min(counts) == len(couples) and max(rotation, direction) <= LARGEST_ANGLE


here = [name for name in FROM_SLOW_TO_FAST if (folder / f"{name}.jsonl").exists()]
print(f"{len(read('aarch64'))} pairs; how many have the same:\n")
print("| instructions | against | models | inliers | iterations | rotation off by | direction off by |")
print("|---|---|---|---|---|---|---|")
same = [compare("aarch64", other) for other in here]
same += [compare(name, here[-1]) for name in here[:-1]]
if not all(same):
    sys.exit(f"error: some answers differ by more than {LARGEST_ANGLE}° or in what is counted")
