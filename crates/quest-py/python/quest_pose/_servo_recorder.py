"""``Recorder``: what every image of a run showed and what came of it."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose._core import QuestError, ShapeMismatch

VERSION = 1
"""Of the format: a number that grows when a reader of the old one would be wrong."""

# What is kept of a command where it has it, and the shape of what stands there while there is none.
NUMBERS: dict[str, tuple[int, ...]] = {
    "linear": (3,),
    "angular": (3,),
    "R": (3, 3),
    "t": (3,),
    "covariance": (6, 6),
    "residual": (),
    "seen": (),
    "inliers": (),
    "hypotheses": (),
    "holding_seconds": (),
    "restarts": (),
}
FLAGS = ("arrived", "border_limits")
WORDS = ("state", "advice")
ALWAYS = ("stamp", "points", "linear", "angular", "state")


class Recorder:
    """A run as columns with one row an image, for ``quest-cli servo --replay`` and for NumPy.

    Parameters
    ----------
    path : str or os.PathLike, optional
        Where ``save`` and the end of a ``with`` block write to.

    Notes
    -----
    The columns: ``stamp`` (F,), ``points`` (F, N, 2), ``inlier_mask`` (F, N), ``linear`` and ``angular`` (F, 3),
    ``R`` (F, 3, 3), ``t`` (F, 3), ``state`` (F,) and what else a ``Command`` says; ``goal`` is (N, 2). NaN stands where an
    image had no such value. The file appears when it is complete, or not at all.

    Examples
    --------
    >>> import numpy as np
    >>> from quest_pose.servo import CameraServo, Recorder
    >>> goal = np.array([[0.1, 0.2], [-0.3, 0.1], [0.2, -0.2], [-0.1, -0.3], [0.3, 0.3]])
    >>> servo = CameraServo(goal, max_speed=0.3, max_turn_rate=0.5, noise=1e-3)
    >>> recorder = Recorder()
    >>> recorder.begin(goal)
    >>> for k in range(3):
    ...     recorder.add(goal, servo.step(goal), stamp=0.1 * k)
    >>> recorder.columns()["points"].shape
    (3, 5, 2)
    """

    def __init__(self, path: str | os.PathLike[str] | None = None) -> None:
        self._path = None if path is None else Path(path)
        if self._path is not None:
            _writer(self._path)
        self._goal: NDArray[np.float64] | None = None
        self._about: dict[str, Any] = {}
        self._rows: list[dict[str, Any]] = []

    def begin(
        self, goal: ArrayLike, *, size: tuple[int, ...] | None = None, options: Mapping[str, Any] | None = None
    ) -> None:
        """Starts a new run; what was recorded before is forgotten. ``Servo`` calls it.

        Parameters
        ----------
        goal : array_like of shape (N, 2)
            The goal's features.
        size : tuple of int, optional
            Width and height of the image in pixels.
        options : mapping, optional
            What the controller was made with: kept as text.
        """
        self._goal = np.array(goal, float).reshape(-1, 2)
        said = {name: v if isinstance(v, (int, float, str)) else repr(v) for name, v in (options or {}).items()}
        self._about = {"size": None if size is None else [int(n) for n in size], "options": said}
        self._rows = []

    def add(self, points: ArrayLike, command: Any, *, stamp: float | None = None) -> None:
        """Adds one image.

        Parameters
        ----------
        points : array_like of shape (N, 2)
            What the controller was given.
        command : Command
            What it returned.
        stamp : float, optional
            When the image was taken, in seconds; the number of the image where it is not known.

        Raises
        ------
        QuestError
            Before ``begin``.
        ShapeMismatch
            For another number of features than the goal has.
        """
        if self._goal is None:
            raise QuestError("no run was begun, expected Recorder.begin(goal) before add")
        rows = np.array(points, float)
        if rows.shape != self._goal.shape:
            raise ShapeMismatch(f"points have the shape {rows.shape}, expected {self._goal.shape} as the goal")
        row: dict[str, Any] = {"stamp": float(len(self._rows) if stamp is None else stamp), "points": rows}
        for name, shape in NUMBERS.items():
            value = getattr(command, name, None)
            if value is not None:
                row[name] = np.asarray(value, float).reshape(shape)
        mask = getattr(command, "inlier_mask", None)
        if mask is not None:
            row["inlier_mask"] = np.array(mask, bool)
        row.update({name: bool(getattr(command, name)) for name in FLAGS if hasattr(command, name)})
        row.update({name: str(getattr(command, name)) for name in WORDS if hasattr(command, name)})
        self._rows.append(row)

    def __len__(self) -> int:
        return len(self._rows)

    def columns(self) -> dict[str, NDArray[Any]]:
        """The run as arrays, one row an image; columns that no command had are left out."""
        if self._goal is None:
            return {}
        made: dict[str, NDArray[Any]] = {"goal": self._goal}
        blanks: dict[str, Any] = {"stamp": np.nan, "points": np.full(self._goal.shape, np.nan)}
        blanks |= {name: np.full(shape, np.nan) for name, shape in NUMBERS.items()}
        blanks |= {"inlier_mask": np.zeros(len(self._goal), bool)}
        blanks |= {name: False for name in FLAGS} | {name: "" for name in WORDS}
        for name, blank in blanks.items():
            if name in ALWAYS or any(name in row for row in self._rows):
                values = np.array([row.get(name, blank) for row in self._rows], np.asarray(blank).dtype.type)
                made[name] = values.reshape(len(self._rows), *np.shape(blank))
        return made

    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Writes the run: ``.npz``, or ``.parquet`` where pyarrow is installed.

        Parameters
        ----------
        path : str or os.PathLike, optional
            The file; that of the constructor where it is not given.

        Raises
        ------
        QuestError
            Without a path, without a run, for another extension.
        OSError
            Where it cannot be written. A file that was there is then as it was.
        """
        target = self._path if path is None else Path(path)
        if target is None:
            raise QuestError("no path was given, expected one in Recorder(path) or save(path)")
        if self._goal is None:
            raise QuestError("no run was begun, expected Recorder.begin(goal) before save")
        content = _writer(target)(self.columns(), {"version": VERSION, **self._about})
        with _replaced(target) as file:
            file.write(content)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # A run that ended with an exception is the one to look at.
        if self._path is not None and self._goal is not None:
            self.save()

    def __repr__(self) -> str:
        return f"<Recorder of {len(self)} images>"


def _writer(path: Path) -> Any:
    """What makes the bytes of a file with this extension."""
    kinds = {".npz": _npz, ".parquet": _parquet}
    if path.suffix not in kinds:
        raise QuestError(f"{path} ends in {path.suffix!r}, expected .npz or .parquet")
    if path.suffix == ".parquet":
        _pyarrow()
    return kinds[path.suffix]


def _pyarrow() -> tuple[Any, Any]:
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise ImportError("Parquet needs pyarrow, which is not installed: pip install pyarrow, or write .npz") from error


def _npz(columns: dict[str, NDArray[Any]], about: dict[str, Any]) -> bytes:
    """Words become numbers, the words themselves JSON in ``about``: readers in other languages have no strings."""
    about = dict(about)
    arrays = dict(columns)
    for name in WORDS:
        if name in arrays:
            words, numbers = np.unique(arrays[name], return_inverse=True)
            about[name] = words.tolist()
            arrays[name] = numbers.astype(np.int32)
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    file = io.BytesIO()
    write: Any = np.savez_compressed
    write(file, **arrays)
    return file.getvalue()


def _parquet(columns: dict[str, NDArray[Any]], about: dict[str, Any]) -> bytes:
    """A row an image, arrays as lists row by row; goal and ``about`` are in the schema's metadata."""
    pa, pq = _pyarrow()
    columns = dict(columns)
    about = {**about, "goal": columns.pop("goal").tolist()}
    lists = {name: list(v.reshape(len(v), -1)) if v.ndim > 1 else v for name, v in columns.items()}
    table = pa.table(lists)
    file = io.BytesIO()
    pq.write_table(table.replace_schema_metadata({"quest-pose": json.dumps(about)}), file)
    return file.getvalue()


@contextlib.contextmanager
def _replaced(path: Path) -> Iterator[Any]:
    """A file that takes the place of ``path`` when the block ends well."""
    handle, name = tempfile.mkstemp(prefix=".quest-", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        # As a new file has it, not the private one of temporary files.
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~mask)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise
