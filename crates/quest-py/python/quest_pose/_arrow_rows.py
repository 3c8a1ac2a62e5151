"""The rows of a table of Arrow: which of them are pairs, why the others are none, and the arrays of those that are."""

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quest_pose._core import Camera, QuestError

_MODELS = {"camera1": "params1", "camera2": "params2"}
# A column that has no meaning without another one, and that one.
_NEEDS = [
    ("camera1", "params1"),
    ("camera2", "params2"),
    ("params1", "camera1"),
    ("params2", "camera2"),
    ("camera2", "camera1"),
]
_COLUMNS = ["pair", "x1", "x2", *_MODELS, *_MODELS.values(), "score"]


def load(module: str = "pyarrow") -> Any:
    """pyarrow or a module of it, which only tables need."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError("tables of Arrow and Parquet need pyarrow: pip install quest-pose[arrow]") from error


class Rows:
    """Rows that are pairs, and a reason for each of the others.

    Parameters
    ----------
    table : pyarrow.Table
        With the columns of ``arrow.schema_in()``.
    keys : array_like of int
        The key of each row that has none of its own.
    """

    def __init__(self, table: Any, keys: Any) -> None:
        names = table.column_names
        self._names = names
        # What other columns hold is not looked at.
        self._columns = {name: table.column(name).combine_chunks() for name in _COLUMNS if name in names}
        count = table.num_rows
        self.keys = _keys(self._columns.get("pair"), keys)
        self.reasons = [""] * count
        self.is_pair = np.ones(count, dtype=bool)
        first_points, second_points = self._points("x1"), self._points("x2")
        differ = first_points != second_points
        self._refuse(differ, lambda k: f"x2: found {second_points[k]} points, expected {first_points[k]} as in x1")
        self.has_score = np.zeros(count, dtype=bool)
        if "score" in names:
            self._score(first_points)
        self._cameras: dict[str, list[Camera | None]] = {}
        for name, needed in _NEEDS:
            if name in names and needed not in names:
                raise QuestError(f"found the columns {names}, expected also {needed}")
        for name in _MODELS:
            if name in names:
                self._read_cameras(name)

    def arrays(self, rows: NDArray[np.int64]) -> tuple[Any, Any, Any, dict[str, Any]]:
        """``x1, x2, offsets`` of rows that are pairs, and the options of ``estimate_batch`` that go with them."""
        x1, offsets = self._flat_points("x1", rows)
        x2, _ = self._flat_points("x2", rows)
        options: dict[str, Any] = {"indices": self.keys[rows]}
        if self.has_score[rows[0]]:
            options["scores"] = _numbers(_taken(self._columns["score"], rows).flatten())
        if self._cameras:
            cameras1 = [self._cameras["camera1"][k] for k in rows]
            others = self._cameras.get("camera2")
            options["cameras1"] = cameras1
            options["cameras2"] = [others[k] or cameras1[i] for i, k in enumerate(rows)] if others else cameras1
        return x1, x2, offsets, options

    def _refuse(self, is_wrong: NDArray[np.bool_], reason: Callable[[int], str]) -> None:
        """Gives a reason to rows that were pairs so far."""
        for k in np.flatnonzero(is_wrong & self.is_pair).tolist():
            self.reasons[k] = reason(k)
            self.is_pair[k] = False

    def _points(self, name: str) -> NDArray[np.int64]:
        """How many points each row of a column has."""
        pa, pc = load(), load("pyarrow.compute")

        if name not in self._columns:
            raise QuestError(f"found the columns {self._names}, expected also {name}")
        column = self._columns[name]
        if not _is_list(column.type) or not _is_list(column.type.value_type) or not _is_number(column.type.value_type.value_type):
            raise QuestError(f"the column {name} is of {column.type}, expected lists of points")
        self._refuse(_is_null(column), lambda _: f"{name}: found null, expected a list of points")
        widths = np.asarray(pc.fill_null(pc.list_value_length(pc.list_flatten(column)), 0))
        # Bearings have three.
        expected = 3 if 2 * np.count_nonzero(widths == 3) > len(widths) else 2
        wrong = np.flatnonzero(widths != expected)
        if len(wrong):
            of_row = dict(zip(np.asarray(pc.list_parent_indices(column))[wrong][::-1], widths[wrong][::-1], strict=True))
            is_wrong = np.isin(np.arange(len(column)), list(of_row))
            self._refuse(is_wrong, lambda k: f"{name}: found a point of {of_row[k]} numbers, expected {expected}")
        return np.asarray(pc.fill_null(pc.list_value_length(column), 0).cast(pa.int64()))

    def _flat_points(self, name: str, rows: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The points of rows, NaN for numbers that are null, and where each row begins."""
        pc = load("pyarrow.compute")

        column = _taken(self._columns[name], rows)
        points = column.flatten()
        numbers = _numbers(pc.list_flatten(points))
        lengths = np.asarray(pc.list_value_length(column), dtype=np.int64)
        return numbers.reshape(len(points), -1 if len(points) else 2), np.concatenate([[0], np.cumsum(lengths)])

    def _score(self, counts: NDArray[np.int64]) -> None:
        pc = load("pyarrow.compute")

        column = self._columns["score"]
        if not _is_list(column.type) or not _is_number(column.type.value_type):
            raise QuestError(f"the column score is of {column.type}, expected lists of numbers")
        self.has_score = ~_is_null(column)
        found = np.asarray(pc.fill_null(pc.list_value_length(column), 0))
        wrong = self.has_score & (found != counts)
        self._refuse(wrong, lambda k: f"score: found {found[k]} scores, expected {counts[k]}, one a match")
        is_finite = np.isfinite(_numbers(pc.list_flatten(column)))
        if not is_finite.all():
            rows = np.asarray(pc.list_parent_indices(column))[~is_finite]
            is_wrong = np.isin(np.arange(len(column)), rows)
            self._refuse(is_wrong, lambda _: "score: found a number that is not finite, expected finite ones")

    def _read_cameras(self, name: str) -> None:
        """A camera a row; equal ones are made once."""
        parameters = _MODELS[name]
        models, params = self._columns[name].to_pylist(), self._columns[parameters].to_pylist()
        made: dict[tuple[str, tuple[float, ...]], Camera | str] = {}
        cameras: list[Camera | None] = [None] * len(models)
        faults = [""] * len(models)
        for k, (model, numbers) in enumerate(zip(models, params, strict=True)):
            if model is None:
                # The second camera is the first one where it has no model.
                faults[k] = f"{name}: found null, expected a model" if name == "camera1" else ""
                continue
            if numbers is None:
                faults[k] = f"{parameters}: found null, expected a list"
                continue
            key = model, tuple(numbers)
            if key not in made:
                made[key] = _camera(name, *key)
            camera = made[key]
            if isinstance(camera, Camera):
                cameras[k] = camera
            else:
                faults[k] = camera
        self._refuse(np.array([bool(fault) for fault in faults], dtype=bool), faults.__getitem__)
        self._cameras[name] = cameras


def _camera(name: str, model: str, params: tuple[float, ...]) -> Camera | str:
    """A camera, or why it is none."""
    try:
        return Camera(model, params)
    except (QuestError, TypeError) as error:
        return f"{name}: {error}"


def _taken(column: Any, rows: NDArray[np.int64]) -> Any:
    return column if len(rows) == len(column) else column.take(rows)


def _is_list(kind: Any) -> bool:
    pa = load()

    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _is_number(kind: Any) -> bool:
    pa = load()

    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind))


def _is_null(column: Any) -> NDArray[np.bool_]:
    return np.asarray(column.is_null()) if column.null_count else np.zeros(len(column), dtype=bool)


def _numbers(values: Any) -> NDArray[np.float64]:
    """Numbers in double precision, NaN for those that are null."""
    return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)


def _keys(column: Any, others: Any) -> NDArray[np.uint64]:
    """The keys of the rows, those of ``others`` where there are none."""
    pa = load()

    numbers: NDArray[np.uint64] = np.asarray(others, dtype=np.uint64)
    if column is None:
        return numbers
    if not pa.types.is_integer(column.type):
        raise QuestError(f"the column pair is of {column.type}, expected whole numbers")
    is_null = _is_null(column)
    given = np.asarray(column.fill_null(0) if column.null_count else column).astype(np.uint64)
    return np.where(is_null, numbers, given)
