"""Columns of Arrow in and out: for Parquet, Spark, Ray, Dask, DuckDB, Polars.

``estimate`` takes anything with the Arrow PyCapsule interface (``__arrow_c_array__`` or ``__arrow_c_stream__``) and returns a
``pyarrow.RecordBatch``, which has it too. pyarrow is imported when a function is called: ``pip install quest-pose[arrow]``.

Columns in
----------
======================= ================================== ==========================================================
pair                    uint64 or int64, optional          the key of the pair, which seeds its search; else the row
x1, x2                  list of lists of 2                 the points of its matches, numbers of any kind
camera1, camera2        string, optional                   COLMAP's name of the model; camera1 where camera2 is absent
params1, params2        list of double, with the cameras   COLMAP's parameters
score                   list of numbers, optional          one a match, higher is better
======================= ================================== ==========================================================

Other columns are left out. Columns out: ``schema_out()``. A row that is no pair (a null, lists of different lengths, a model of a
camera that does not exist) has no pose and a ``reason``, and costs no other row its own. A number that is null is a NaN: its match
has no bearing. A pair without a key has the number of its row.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from quest_pose._arrow_rows import Rows, load
from quest_pose._core import EstimateBatch, QuestError, estimate_batch

if TYPE_CHECKING:
    import pyarrow

__all__ = ["estimate", "schema_in", "schema_out"]


def schema_in() -> "pyarrow.Schema":
    """The columns of ``estimate``, as they are read without a copy."""
    pa = load()

    points = pa.list_(pa.list_(pa.float64(), 2))
    return pa.schema(
        [
            ("pair", pa.uint64()),
            ("x1", points),
            ("x2", points),
            ("camera1", pa.string()),
            ("params1", pa.list_(pa.float64())),
            ("camera2", pa.string()),
            ("params2", pa.list_(pa.float64())),
            ("score", pa.list_(pa.float64())),
        ]
    )


def schema_out() -> "pyarrow.Schema":
    """The columns that ``estimate`` returns: null where a pair has no pose, and then its ``reason``."""
    pa = load()

    def vector(size: int) -> Any:
        return pa.list_(pa.float64(), size)

    return pa.schema(
        [
            ("pair", pa.uint64()),
            ("model", pa.string()),
            ("reason", pa.string()),
            ("q_wxyz", vector(4)),
            ("t", vector(3)),
            ("covariance", vector(36)),
            ("parallax", pa.float64()),
            ("noise_px", pa.float64()),
            ("inlier_count", pa.int64()),
            ("invalid_count", pa.int64()),
            ("iterations", pa.int64()),
            ("score", pa.float64()),
            ("inliers", pa.list_(pa.bool_())),
            ("runner_up_q_wxyz", vector(4)),
            ("runner_up_t", vector(3)),
            ("normal", vector(3)),
            ("false_share", pa.float64()),
            ("unmoved", pa.int64()),
        ]
    )


def estimate(batch: Any, *, num_threads: int = 1, **options: Any) -> "pyarrow.RecordBatch":
    """The poses of the pairs of a record batch, a row each.

    Parameters
    ----------
    batch
        A record batch or table, or anything with the Arrow PyCapsule interface, with the columns above.
    num_threads : int
        One by default: a worker of a cluster is one of many on its machine. All of the machine's for 0.
    options
        Those of ``estimate_batch``. Where there is no column ``pair``, ``first_index`` is the number of the first row, and
        ``indices`` has the keys.

    Returns
    -------
    pyarrow.RecordBatch
        With ``schema_out()``, in the order of the rows. The same bits whatever the partition of the rows, and the threads,
        where there is a column ``pair``.

    Raises
    ------
    ImportError
        Without pyarrow.
    QuestError
        For a column that is missing or of another form, and as ``estimate_batch``. A single row costs its own pose alone.
    """
    pa = load()

    table = _table(pa, batch)
    first = int(options.pop("first_index", 0))
    rows = Rows(table, options.pop("indices", range(first, first + table.num_rows)))
    batches, places = [], []
    # Scores are given to all pairs of a batch or to none. The other pairs of a batch change no answer.
    for has_score in (False, True):
        chosen = np.flatnonzero(rows.is_pair & (rows.has_score == has_score))
        if len(chosen):
            x1, x2, offsets, others = rows.arrays(chosen)
            found = estimate_batch(x1, x2, offsets, num_threads=num_threads, **options | others)
            batches.append(_record_batch(pa, rows.keys[chosen], found))
            places.append(chosen)
    refused = np.flatnonzero(~rows.is_pair)
    batches.append(_without_pose(pa, rows.keys[refused], [rows.reasons[k] for k in refused]))
    places.append(refused)
    all_rows = pa.Table.from_batches(batches)
    if any(0 < len(chosen) < len(rows.keys) for chosen in places):
        all_rows = all_rows.take(np.argsort(np.concatenate(places)))
    whole = all_rows.combine_chunks().to_batches()
    return whole[0] if whole else batches[0]


def _table(pa: Any, batch: Any) -> Any:
    if isinstance(batch, pa.Table):
        return batch.combine_chunks()
    if isinstance(batch, pa.RecordBatch):
        return pa.Table.from_batches([batch])
    if hasattr(batch, "__arrow_c_stream__"):
        return pa.table(batch).combine_chunks()
    if hasattr(batch, "__arrow_c_array__"):
        return pa.Table.from_batches([pa.record_batch(batch)])
    raise QuestError(f"found {type(batch).__name__}, expected a record batch or a table of Arrow")


def _without_pose(pa: Any, keys: Any, reasons: list[str]) -> Any:
    """Rows that are no pairs, and why."""
    counts = {"inlier_count", "invalid_count", "iterations", "unmoved"}
    rows = [
        {"pair": key, "reason": reason, "inliers": []} | dict.fromkeys(counts, 0)
        for key, reason in zip(keys.tolist(), reasons, strict=True)
    ]
    return pa.RecordBatch.from_pylist(rows, schema=schema_out())


def _record_batch(pa: Any, keys: Any, found: EstimateBatch) -> Any:
    absent = ~found.found
    other = np.isnan(found.runner_up_t[:, 0]) if len(found) else absent
    no_plane = np.isnan(found.normal[:, 0]) if len(found) else absent

    def vectors(values: Any, mask: Any) -> Any:
        flat = np.ascontiguousarray(values).reshape(len(found), values.shape[1])
        numbers = pa.array(flat.ravel())
        return pa.FixedSizeListArray.from_arrays(numbers, flat.shape[1], mask=pa.array(mask))

    inliers = pa.ListArray.from_arrays(pa.array(found.offsets.astype(np.int32)), pa.array(found.inliers))
    columns = [
        pa.array(keys),
        pa.array(found.model, pa.string()),
        pa.array(found.reason, pa.string()),
        vectors(found.quat_wxyz, absent),
        vectors(found.t, absent),
        vectors(found.covariance.reshape(-1, 36), absent),
        pa.array(found.parallax, mask=absent),
        pa.array(found.noise_px, mask=absent),
        pa.array(found.inlier_count.astype(np.int64)),
        pa.array(found.invalid_count.astype(np.int64)),
        pa.array(found.iterations.astype(np.int64)),
        pa.array(found.score, mask=absent),
        inliers,
        vectors(found.runner_up_quat_wxyz, other),
        vectors(found.runner_up_t, other),
        vectors(found.normal, no_plane),
        pa.array(found.false_share, mask=absent),
        pa.array(found.unmoved.astype(np.int64)),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=schema_out())
