"""Poses of Parquet files on a cluster of Dask: ``pip install quest-pose[dask]``.

>>> from dask.distributed import Client                                        # doctest: +SKIP
>>> from quest_pose import dask                                                # doctest: +SKIP
>>> dask.estimate_parquet(Client(), "pairs.parquet", "poses", threshold=1.0)   # doctest: +SKIP
"""

import os
from pathlib import Path
from typing import Any

from quest_pose import arrow
from quest_pose._arrow_rows import load

__all__ = ["estimate_block", "estimate_parquet"]


def estimate_parquet(
    client: Any,
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    rows: int = 5000,
    num_threads: int = 1,
    **options: Any,
) -> list[Path]:
    """The poses of the pairs of Parquet files, a block of rows at a time, each into a file of its own.

    A block's file appears when it is whole; blocks whose files are there are skipped, so that a run that was ended goes on
    where it was, and a worker that is lost costs its blocks alone.

    Parameters
    ----------
    client : dask.distributed.Client
    source : path
        A Parquet file, or a folder of them, with the columns of ``quest_pose.arrow.estimate``, ``pair`` among them, which all
        workers can read.
    target : path
        A folder that all workers can write to.
    rows : int
        Rows of a block.
    num_threads : int
        Threads of a block: one by default, for as many workers as there are cores.
    options
        Those of ``estimate_batch``.

    Returns
    -------
    list of pathlib.Path
        The files of the blocks, in the order of the rows.

    Raises
    ------
    ImportError
        Without pyarrow.
    QuestError
        For a source without the columns.
    """
    parquet = load("pyarrow.parquet")
    source, target = Path(source), Path(target)
    target.mkdir(parents=True, exist_ok=True)
    files = sorted(source.glob("*.parquet")) if source.is_dir() else [source]
    blocks = []
    for file in files:
        count = parquet.ParquetFile(file).metadata.num_rows
        for first in range(0, count, rows):
            blocks.append((file, first, target / f"{file.stem}-{first:012d}.parquet"))
    open_blocks = [block for block in blocks if not block[2].exists()]
    futures = [
        client.submit(estimate_block, *block, rows, num_threads=num_threads, pure=False, **options) for block in open_blocks
    ]
    client.gather(futures)
    return [block[2] for block in blocks]


def estimate_block(
    source: str | os.PathLike[str],
    first: int,
    target: str | os.PathLike[str],
    rows: int,
    *,
    num_threads: int = 1,
    **options: Any,
) -> str:
    """The poses of the rows from ``first`` on, into a file that appears when it is whole.

    Returns
    -------
    str
        The file.
    """
    pa, parquet = load(), load("pyarrow.parquet")
    target = Path(target)
    if target.exists():
        return str(target)
    table = _rows(parquet.ParquetFile(source), first, rows)
    options.setdefault("first_index", first)
    found = arrow.estimate(table, num_threads=num_threads, **options)
    # Of this process alone: two workers that were given the same block do not meet.
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        parquet.write_table(pa.Table.from_batches([found]), part)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
    return str(target)


def _rows(file: Any, first: int, count: int) -> Any:
    """Rows of a Parquet file, by its row groups that hold them."""
    begin, groups, skipped = 0, [], 0
    for group in range(file.metadata.num_row_groups):
        size = file.metadata.row_group(group).num_rows
        if begin + size <= first:
            skipped += size
        elif begin < first + count:
            groups.append(group)
        begin += size
    return file.read_row_groups(groups).slice(first - skipped, count)
