"""`quest-cli colmap verify` killed at random moments, on a full disk, in a file that is read-only, beside another writer.

    python benches/peers/faults.py --cli target/release/quest-cli --kills 100

After each fault the database must open, pass `PRAGMA integrity_check` and hold the old rows or all the new ones, and `--resume` must
complete it to the bytes of a run without faults. A full disk is a tmpfs of a few pages more than the database, which takes the
rights of root; a read-only file is tried as the user `nobody`.
"""

import argparse
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import tempfile
import time
from collections import Counter
from contextlib import closing
from pathlib import Path

from planted_databases import Scene, plant

Rows = dict[int, tuple[object, ...]]


def command(cli: Path, database: Path, *more: str) -> list[str]:
    return [str(cli), "colmap", "verify", str(database), "--threads", "1", "--quiet", *more]


def rows(database: Path) -> Rows:
    """Every column of every row."""
    with closing(sqlite3.connect(database)) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",), database
        return {row[0]: row for row in db.execute("SELECT * FROM two_view_geometries")}


def copied(base: Path, database: Path, journal: str) -> Path:
    for end in ("", "-journal", "-wal", "-shm"):
        Path(f"{database}{end}").unlink(missing_ok=True)
    shutil.copy(base, database)
    with closing(sqlite3.connect(database)) as db:
        db.execute(f"PRAGMA journal_mode = {journal}")
    return database


def killed(cli: Path, base: Path, folder: Path, kills: int, seed: int, expected: Rows) -> Counter[str]:
    """Runs that are killed at moments drawn from their whole length and a little more."""
    draw = random.Random(seed)
    old = rows(base)
    start = time.monotonic()
    subprocess.run(command(cli, copied(base, folder / "timed.db", "delete"), "--resume"), check=True, stdout=subprocess.DEVNULL)
    length = time.monotonic() - start
    outcomes: Counter[str] = Counter()
    for kill in range(kills):
        journal = ("delete", "wal")[kill % 2]
        database = copied(base, folder / "killed.db", journal)
        process = subprocess.Popen(command(cli, database, "--resume"), stdout=subprocess.DEVNULL)
        # Half of the moments lie in the last tenth, where the rows are written out.
        moment = draw.uniform(0, length) if kill % 4 < 2 else draw.uniform(0.9 * length, 1.1 * length)
        time.sleep(moment)
        process.send_signal(signal.SIGKILL)
        was_killed = process.wait() == -signal.SIGKILL
        left = rows(database)
        assert left in (old, expected), f"kill {kill} after {moment} s left {len(left)} rows"
        outcomes[f"{journal}, {'killed' if was_killed else 'had ended'}, {'old' if left == old else 'new'} rows"] += 1
        subprocess.run(command(cli, database, "--resume"), check=True, stdout=subprocess.DEVNULL)
        assert rows(database) == expected, f"kill {kill}: --resume made other rows"
    return outcomes


def refused(run: list[str], word: str) -> str:
    found = subprocess.run(run, capture_output=True, text=True, check=False)
    assert found.returncode == 2 and word in found.stderr, (found.returncode, found.stderr)
    return found.stderr.strip()


def full_disk(cli: Path, base: Path, expected: Rows, journal: str) -> str:
    """A file system with room for the database and sixteen pages more."""
    mount = Path(tempfile.mkdtemp())
    size = (base.stat().st_size + 4095) // 4096 * 4096 + 16 * 4096
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", mount], check=True)
    try:
        database = copied(base, mount / "full.db", journal)
        said = refused(command(cli, database, "--resume"), "full")
        # SQLite itself needs room to read a database in WAL mode.
        subprocess.run(["mount", "-o", f"remount,size={4 * size}", mount], check=True)
        assert rows(database) == rows(base)
        subprocess.run(command(cli, database, "--resume"), check=True, stdout=subprocess.DEVNULL)
        assert rows(database) == expected
    finally:
        subprocess.run(["umount", mount], check=True)
        mount.rmdir()
    return said


def read_only(cli: Path, base: Path, folder: Path) -> str:
    database = copied(base, folder / "readonly.db", "delete")
    database.chmod(0o444)
    folder.chmod(0o755)
    as_nobody = ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"] if os.getuid() == 0 else []
    said = refused([*as_nobody, *command(cli, database, "--resume")], "read-only")
    assert rows(database) == rows(base)
    return said


def two_writers(cli: Path, base: Path, folder: Path, expected: Rows) -> list[str]:
    """Another program that is writing, and a second quest-cli."""
    database = copied(base, folder / "two.db", "delete")
    other = sqlite3.connect(database, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    said = [refused(command(cli, database, "--resume"), "another program is writing")]
    other.execute("ROLLBACK")
    other.close()
    runs = [subprocess.Popen(command(cli, database, "--resume"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) for _ in (0, 1)]
    ends = [(run.communicate()[1].strip(), run.returncode) for run in runs]
    assert sorted(code for _, code in ends) in ([0, 0], [0, 2]), ends
    assert rows(database) == expected
    return said + [error for error, code in ends if code]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cli", type=Path, default=Path("target/release/quest-cli"))
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=24)
    parser.add_argument("--images", type=int, default=30)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        base = folder / "base.db"
        plant(base, Scene(arguments.images, 0.4), arguments.seed)
        names = [f"{k:03d}.jpg" for k in range(arguments.images)]
        listed = folder / "pairs.txt"
        listed.write_text("".join(f"{names[k]} {names[k + 1]}\n" for k in range(arguments.images - 1)))
        run = command(arguments.cli, base, "--pairs", str(listed))
        subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
        whole = copied(base, folder / "whole.db", "delete")
        subprocess.run(command(arguments.cli, whole, "--resume"), check=True, stdout=subprocess.DEVNULL)
        expected = rows(whole)
        print(f"{len(rows(base))} rows before, {len(expected)} after")
        print("read-only:", read_only(arguments.cli, base, folder))
        print("two writers:", *two_writers(arguments.cli, base, folder, expected), sep="\n  ")
        if os.getuid() == 0:
            for journal in ("delete", "wal"):
                print(f"full disk, {journal}:", full_disk(arguments.cli, base, expected, journal))
        for outcome, count in sorted(killed(arguments.cli, base, folder, arguments.kills, arguments.seed, expected).items()):
            print(f"{count:4}  {outcome}")


if __name__ == "__main__":
    main()
