"""Adds up what llvm-cov exported, for scripts/coverage: by crate, and for the files that miss most."""

import json
import pathlib
import re
import sys
from collections import defaultdict

CRATES = ["quest-core", "quest-io"]
SHOWN = 25
root = pathlib.Path.cwd()
folder = pathlib.Path(sys.argv[1])


def first_line_of_tests(path):
    """Where the tests in a file begin, which stand at its end."""
    text = path.read_text().splitlines()
    for number, line in enumerate(text, 1):
        is_module = number < len(text) and re.match(r"(pub(\(.*\))? )?mod \w+ \{", text[number])
        if line == "#[cfg(test)]" and is_module:
            return number
    return len(text) + 1


def place(name):
    """The crate of a file and its path there, if it is one of ours and no test."""
    path = root / name
    if not path.is_relative_to(root / "crates"):
        return None
    crate, *rest = path.relative_to(root / "crates").parts
    is_test = any(part in ("tests", "examples", "test.rs", "tests.rs") for part in rest)
    return None if crate not in CRATES or is_test else (crate, "/".join(rest))


def source(where):
    return root / "crates" / where[0] / where[1]


lines, branches = defaultdict(dict), defaultdict(dict)
for record in (folder / "lines.lcov").read_text().split("end_of_record"):
    name = re.search(r"^SF:(.*)$", record, re.M)
    where = name and place(name[1])
    if where:
        end = first_line_of_tests(source(where))
        for number, count in re.findall(r"^DA:(\d+),(\d+)", record, re.M):
            if int(number) < end:
                lines[where][int(number)] = lines[where].get(int(number), 0) + int(count)

# A branch of a generic function stands there once for each type that it is compiled for.
for file in json.loads((folder / "branches.json").read_text())["data"][0]["files"]:
    where = place(file["filename"])
    if where:
        end = first_line_of_tests(source(where))
        for line1, column1, line2, column2, taken, passed, *_ in file["branches"]:
            if line1 < end:
                sides = branches[where].setdefault((line1, column1, line2, column2), [0, 0])
                sides[0] += taken
                sides[1] += passed


def share(counts):
    reached = sum(count > 0 for count in counts)
    return f"{100 * reached / len(counts):.1f} % of {len(counts)}" if counts else "none"


for crate in CRATES:
    of_lines = [n for where in lines if where[0] == crate for n in lines[where].values()]
    of_sides = [n for where in branches if where[0] == crate for both in branches[where].values() for n in both]
    print(f"{crate:10}  lines {share(of_lines)}  branches {share(of_sides)}")

missed = []
for where in lines:
    never = sorted(number for number, count in lines[where].items() if count == 0)
    sides = [
        f"{line}:{column} {'true' if side == 0 else 'false'}"
        for (line, column, *_), both in sorted(branches[where].items())
        for side in (0, 1)
        if both[side] == 0
    ]
    missed.append((len(never) + len(sides), where, never, sides))
print("\nmissed most:")
for count, where, never, sides in sorted(missed, reverse=True)[:SHOWN]:
    if count:
        print(f"{'/'.join(where)}\n  lines {never}\n  branches {', '.join(sides)}")
