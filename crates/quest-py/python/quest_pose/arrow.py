"""Columns of Arrow in and out: for Parquet, Spark, Ray, Dask, DuckDB, Polars.

``estimate`` takes anything with the Arrow PyCapsule interface (``__arrow_c_array__`` or ``__arrow_c_stream__``) and returns a
``pyarrow.RecordBatch``, which has it too. pyarrow is imported when a function is called: ``pip install quest-pose[arrow]``.

Columns in
----------
======================= ================================== ==========================================================
pair                    uint64 or int64, optional          the key of the pair, which seeds its search; else the row
x1, x2                  list of fixed-size list of 2       the points of its matches, float32 or float64
camera1, camera2        string, optional                   COLMAP's name of the model; camera1 where camera2 is absent
params1, params2        list of double, with the cameras   COLMAP's parameters
score                   list of float, optional            one a match, higher is better
======================= ================================== ==========================================================

Other columns are left out. Columns out: ``schema_out()``.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from quest_pose._core import Camera, EstimateBatch, QuestError, estimate_batch

if TYPE_CHECKING:
    import pyarrow

__all__ = ["estimate", "schema_in", "schema_out"]


def schema_in() -> "pyarrow.Schema":
    """The columns of ``estimate``, as they are read without a copy."""
    import pyarrow as pa

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
    import pyarrow as pa

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
        Those of ``estimate_batch``. ``first_index`` is the number of the first row where there is no column ``pair``.

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
        For a column that is missing or of another form, and as ``estimate_batch``.
    """
    import pyarrow as pa

    table = _table(pa, batch)
    x1, offsets = _points(table, "x1")
    x2, others = _points(table, "x2")
    if not np.array_equal(offsets, others):
        raise QuestError("the lists of x1 and x2 differ in length, expected as many points in both")
    names = set(table.column_names)
    if "pair" in names:
        options["indices"] = np.asarray(_column(table, "pair"))
    if "score" in names:
        scores, lengths = _lists(table, "score")
        if not np.array_equal(lengths, offsets):
            raise QuestError("the lists of score differ in length from those of x1, expected one a match")
        options["scores"] = scores
    if "camera1" in names:
        options["cameras1"] = cameras = _cameras(table, "camera1", "params1")
        options["cameras2"] = _cameras(table, "camera2", "params2") if "camera2" in names else cameras
        if table.num_rows == 0:
            options |= {"cameras1": None, "cameras2": None, "threshold": options.get("threshold") or 1.0}
    found = estimate_batch(x1, x2, offsets, num_threads=num_threads, **options)
    first = int(options.get("first_index", 0))
    keys = options.get("indices", np.arange(first, first + len(found), dtype=np.uint64))
    return _record_batch(pa, np.asarray(keys, dtype=np.uint64), found)


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


def _column(table: Any, name: str) -> Any:
    if name not in table.column_names:
        raise QuestError(f"found the columns {table.column_names}, expected also {name}")
    column = table.column(name).combine_chunks()
    if column.null_count:
        raise QuestError(f"the column {name} holds {column.null_count} nulls, expected none")
    return column


def _lists(table: Any, name: str) -> tuple[Any, Any]:
    """The numbers of a column of lists, and where each list begins."""
    import pyarrow as pa

    column = _column(table, name)
    if not (pa.types.is_list(column.type) or pa.types.is_large_list(column.type)):
        raise QuestError(f"the column {name} is of {column.type}, expected lists")
    offsets = np.asarray(column.offsets, dtype=np.int64)
    values = column.values.slice(offsets[0], offsets[-1] - offsets[0]) if len(column) else column.values.slice(0, 0)
    return values, offsets - offsets[0] if len(column) else np.zeros(1, np.int64)


def _points(table: Any, name: str) -> tuple[Any, Any]:
    """The points of a column of lists of points, and where each list begins."""
    values, offsets = _lists(table, name)
    if getattr(values.type, "list_size", None) not in (2, 3):
        raise QuestError(f"the points of {name} are of {values.type}, expected fixed_size_list[2] of numbers")
    width = values.type.list_size
    numbers = np.asarray(values.flatten(), dtype=np.float64).reshape(-1, width)
    return numbers, offsets


def _cameras(table: Any, model: str, params: str) -> list[Camera]:
    """A camera a row; equal ones are made once."""
    names = _column(table, model).to_pylist()
    numbers, offsets = _lists(table, params)
    numbers = np.asarray(numbers, dtype=np.float64)
    made: dict[tuple[str, bytes], Camera] = {}
    cameras = []
    for name, a, b in zip(names, offsets[:-1], offsets[1:], strict=True):
        key = name, numbers[a:b].tobytes()
        if key not in made:
            made[key] = Camera(name, numbers[a:b])
        cameras.append(made[key])
    return cameras


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
