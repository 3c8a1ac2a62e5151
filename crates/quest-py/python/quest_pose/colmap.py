"""COLMAP databases: verify their image pairs, write two-view geometries, export matches and poses.

>>> from quest_pose import colmap                                              # doctest: +SKIP
>>> report = colmap.verify("database.db")                                      # doctest: +SKIP
>>> report.summary["verified"], report.summary["pairs"]                        # doctest: +SKIP
(435, 435)

It stands where COLMAP's own verification does, ahead of the mapper. In hloc one line changes:

    pycolmap.verify_matches = quest_pose.colmap.verify_matches
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from quest_pose._core import (
    Estimate,
    EstimateBatch,
    _colmap_export,
    _colmap_read_pairs,
    _colmap_verify,
    _colmap_write,
)

__all__ = [
    "Report",
    "export_matches",
    "export_poses",
    "read_pairs",
    "verify",
    "verify_matches",
    "write_two_view_geometries",
]

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from quest_pose._options import EstimateOptions

_SEARCH = {"threshold": 4.0, "confidence": 0.999, "max_iterations": 10_000}
"""COLMAP's own: what is not given."""

_Path: TypeAlias = str | os.PathLike[str]
_Pairs: TypeAlias = _Path | Iterable[tuple[str, str]]
_Progress: TypeAlias = Callable[[int, int], object]


class Report(NamedTuple):
    """What ``verify`` found."""

    summary: dict[str, Any]
    """Counts: ``pairs``, ``verified``, ``rejected``, ``resumed``, ``uncalibrated``, ``unreadable``, ``configs`` by COLMAP's
    names, ``matches``, ``inliers``, ``invalid``, ``elapsed_s``, ``dry_run``."""
    pairs: list[dict[str, Any]]
    """One dictionary a pair: ``pair_id``, ``image1``, ``image2``, ``matches``, ``invalid``, ``inliers``, ``config``, and where
    there are, ``reason``, ``model``, ``q_21``, ``t_21``, ``noise_px``, ``iterations``."""


def verify(
    database: _Path,
    *,
    pairs: _Pairs | None = None,
    min_inliers: int = 15,
    min_inlier_ratio: float = 0.0,
    existing: Literal["raise", "overwrite", "resume"] = "raise",
    uncalibrated: Literal["skip", "guess"] = "skip",
    watermark: float = 0.7,
    num_threads: int = 0,
    dry_run: bool = False,
    progress: _Progress | None = None,
    **options: Unpack[EstimateOptions],
) -> Report:
    """The two-view geometries of a database: all rows are written in one transaction, or none.

    Parameters
    ----------
    database : path
        A database of COLMAP 3.6 to 4.2; it is not migrated. Only ``two_view_geometries`` is written.
    pairs : path or iterable of (str, str), optional
        The names of the images of the pairs, or a file with two names a line; all pairs with matches where absent.
    min_inliers : int
    min_inlier_ratio : float
        Pairs with fewer inliers, or a smaller part of them, get an empty row.
    existing : {"raise", "overwrite", "resume"}
        What to do with pairs that have a row: refuse to begin, replace it, or leave it and verify the others.
    uncalibrated : {"skip", "guess"}
        What to do with cameras whose focal length is a guess (``prior_focal_length`` is 0): leave their pairs to COLMAP, or
        write a fundamental matrix or homography that is fitted to the pixels, without a pose.
    watermark : float
        The part of the inliers that one shift of the images' border has to explain for a watermark; above 1 for never.
    num_threads : int
        All of the machine's for 0. It changes no row.
    dry_run : bool
        Whether to write nothing.
    progress : callable, optional
        Called with the number of pairs that are done and that of all. An exception ends the run, which writes nothing.
    options
        As for ``estimate``: the keywords of ``EstimateOptions`` but for ``index``, with COLMAP's ``threshold`` of 4 pixels,
        ``confidence`` of 0.999 and ``max_iterations`` of 10,000 where they are absent. A threshold of 4 gives as many points as
        COLMAP, 2 purer inliers. The same ``seed`` gives the same rows, whichever other pairs there are.

    Returns
    -------
    Report

    Raises
    ------
    QuestError
        For a file that is no database, one that is being written by another program or cannot be written, a name that it
        does not have, and an impossible option. The database is as it was.

    Notes
    -----
    The lock of the interpreter is released; Ctrl-C ends the run, and the database is as it was.
    """
    text = _colmap_verify(
        database, _named(pairs), min_inliers, min_inlier_ratio, existing, uncalibrated, watermark, num_threads, dry_run,
        progress, _SEARCH | {**options},
    )  # fmt: skip
    report = json.loads(text)
    return Report(report["summary"], report["pairs"])


def verify_matches(
    database_path: _Path,
    pairs_path: _Path,
    options: Mapping[str, Any] | Any | None = None,
    cancellation_token: object = None,
) -> None:
    """``pycolmap.verify_matches``, by ``verify``.

    Parameters
    ----------
    database_path : path
    pairs_path : path
        A file with the names of two images a line.
    options : mapping or pycolmap.TwoViewGeometryOptions, optional
        Of these are heard: ``min_num_inliers``, ``min_inlier_ratio``, ``detect_watermark``, ``watermark_min_inlier_ratio`` and of
        ``ransac`` ``max_error``, ``confidence``, ``max_num_trials`` and ``random_seed`` (-1 is 0 here).
    cancellation_token
        Plays no part: Ctrl-C ends the run.

    Notes
    -----
    As in COLMAP, pairs that have a row are left as they are, and pairs with a guessed focal length get a fundamental matrix.
    """
    ransac = _option(options, "ransac", None)
    seed = _option(ransac, "random_seed", -1)
    verify(
        database_path,
        pairs=pairs_path,
        threshold=_option(ransac, "max_error", 4.0),
        min_inliers=_option(options, "min_num_inliers", 15),
        min_inlier_ratio=_option(options, "min_inlier_ratio", 0.0),
        confidence=_option(ransac, "confidence", 0.999),
        max_iterations=_option(ransac, "max_num_trials", 10_000),
        existing="resume",
        uncalibrated="guess",
        watermark=_option(options, "watermark_min_inlier_ratio", 0.7)
        if _option(options, "detect_watermark", True)
        else 2.0,
        seed=max(seed, 0),
    )


def read_pairs(path: _Path) -> list[tuple[str, str]]:
    """The pairs of a file with the names of two images a line; blank lines and lines with ``#`` in front are skipped.

    Raises
    ------
    OSError, QuestError
        For a file that cannot be read, and for a line that is not two names.
    """
    return _colmap_read_pairs(path)


def write_two_view_geometries(
    database: _Path,
    pairs: Iterable[tuple[str, str]],
    estimates: EstimateBatch | Sequence[Estimate | None],
    *,
    overwrite: bool = False,
) -> None:
    """Writes poses that were estimated from the matches of a database: all rows in one transaction, or none.

    Parameters
    ----------
    database : path
    pairs : iterable of (str, str)
        The names of the images of each estimate, in the order of its views.
    estimates : EstimateBatch or sequence of Estimate or None
        One a pair, from the rows of its matches in their order; None writes a row without a pose.
    overwrite : bool
        Whether to replace rows that are there.

    Raises
    ------
    QuestError
        For a pair that has a row, unless ``overwrite``; for one that does not fit the database; and as ``verify``.
    """
    named, results = list(pairs), list(estimates)
    if len(named) != len(results):
        raise ValueError(f"found {len(named)} pairs and {len(results)} estimates, expected as many")
    _colmap_write(database, named, results, overwrite)


def export_matches(database: _Path, target: _Path, *, pairs: _Pairs | None = None) -> list[tuple[str, str]]:
    """Writes matches as JSON Lines, one pair a line, as ``quest-cli estimate`` reads them.

    Returns
    -------
    list of (str, str)
        The pairs that were left out, and why.
    """
    return _export(database, target, "matches", pairs, 15, {})


def export_poses(
    database: _Path,
    target: _Path,
    *,
    pairs: _Pairs | None = None,
    min_inliers: int = 15,
    **options: Unpack[EstimateOptions],
) -> list[tuple[str, str]]:
    """Writes poses with their covariances as a graph in g2o's form, every pair estimated again, with the options of ``verify``.

    Returns
    -------
    list of (str, str)
        The pairs that were left out, and why.
    """
    return _export(database, target, "poses", pairs, min_inliers, _SEARCH | {**options})


def _export(
    database: _Path, target: _Path, what: str, pairs: _Pairs | None, min_inliers: int, options: dict[str, Any]
) -> list[tuple[str, str]]:
    part = Path(f"{os.fspath(target)}.part")
    try:
        _, left = _colmap_export(database, part, what, _named(pairs), min_inliers, None, options)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
    return left


def _named(pairs: _Pairs | None) -> list[tuple[str, str]] | None:
    if pairs is None:
        return None
    if isinstance(pairs, (str, os.PathLike)):
        return read_pairs(pairs)
    return [(first, second) for first, second in pairs]


def _option(options: Any, name: str, default: Any) -> Any:
    if options is None:
        return default
    if isinstance(options, Mapping):
        return options.get(name, default)
    return getattr(options, name, default)
