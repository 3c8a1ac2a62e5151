"""No pair spoils another; batches that can be watched, ended and taken apart."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import quest_pose as qp
from scenes import K, make_scene

Array = npt.NDArray[np.float64]

# All pixels of the scenes have a viewing ray: the fold lies at 1.7 focal lengths.
BARREL = qp.Camera("SIMPLE_RADIAL", [1060, 514, 384, -0.05])


def pairs(count: int, n: int = 30, planar: bool = False) -> tuple[Array, Array, list[int]]:
    """``count`` pairs of ``n`` matches, with noise and a fifth of them wrong."""
    rng = np.random.default_rng(11)
    x1, x2 = [], []
    for k in range(count):
        scene = make_scene(100 + k, n, planar=planar)
        u1, u2 = scene.u1 + rng.normal(0, 0.3, (n, 2)), scene.u2 + rng.normal(0, 0.3, (n, 2))
        u2[::5] = rng.uniform(0, 700, u2[::5].shape)
        x1.append(u1)
        x2.append(u2)
    return np.concatenate(x1), np.concatenate(x2), [n * k for k in range(count + 1)]


def test_a_nan_and_a_pixel_without_a_ray_spoil_no_pair() -> None:
    x1, x2, offsets = pairs(12)
    clean = qp.estimate_batch(x1, x2, offsets, BARREL, seed=1)
    bad1, bad2 = x1.copy(), x2.copy()
    bad1[30 * 3 + 2, 0] = np.nan
    bad2[30 * 7 + 4] = 1e5
    found = qp.estimate_batch(bad1, bad2, offsets, BARREL, seed=1)
    for i in range(12):
        if i not in (3, 7):
            assert found[i] == clean[i]
    assert found.invalid_count.tolist() == [int(i in (3, 7)) for i in range(12)]
    assert found.found.all()
    assert not found.inliers[30 * 3 + 2]
    assert not found.inliers[30 * 7 + 4]
    one = found[3]
    assert one is not None
    assert one.invalid_count == 1
    assert len(one.inliers) == 30
    assert one.to_dict().get("invalid_count") == 1
    assert qp.estimate(bad1[90:120], bad2[90:120], BARREL, seed=1, index=3) == one
    with pytest.raises(qp.NotFinite, match="match 92"):
        qp.estimate_batch(bad1, bad2, offsets, BARREL, invalid="raise")
    strict = qp.estimate_batch(bad1, bad2, offsets, BARREL, seed=1, invalid="pair")
    assert strict.found.tolist() == [i not in (3, 7) for i in range(12)]
    assert "NaN" in str(strict.reason[3])
    assert "viewing ray" in str(strict.reason[7])
    assert strict[0] == clean[0]
    with pytest.raises(qp.NoAnswer, match="NaN"):
        qp.estimate(bad1[90:120], bad2[90:120], BARREL, invalid="pair")
    with pytest.raises(qp.QuestError, match=r"invalid.*outlier"):
        qp.estimate(x1[:30], x2[:30], BARREL, invalid="none")  # type: ignore[arg-type]
    hopeless = qp.estimate_batch(x1 * np.nan, x2, offsets, BARREL)
    assert not hopeless.found.any()
    assert "30 more have no bearing" in str(hopeless.reason[0])


def test_one_error_stands_for_no_answer() -> None:
    for error in (qp.NoPose, qp.TooFewMatches, qp.DegenerateInput):
        assert issubclass(error, qp.NoAnswer)
    assert not issubclass(qp.BadCamera, qp.NoAnswer)
    with pytest.raises(qp.NoAnswer):
        qp.estimate(np.zeros((3, 2)), np.zeros((3, 2)), K)


def test_keys_make_answers_independent_of_the_other_pairs() -> None:
    x1, x2, offsets = pairs(6)
    keys = np.array([7, 2**40, 2**62 + 1, 9, 11, 13], np.uint64)
    whole = qp.estimate_batch(x1, x2, offsets, K, indices=keys)
    part = qp.estimate_batch(x1[60:90], x2[60:90], [0, 30], K, indices=keys[2:3])
    assert part[0] == whole[2]
    assert whole[0] == qp.estimate(x1[:30], x2[:30], K, index=7)
    refused: list[tuple[Any, str]] = [(keys[:2], "indices has 2"), ([-1] * 6, "negative"), ([0.5] * 6, "whole")]
    for bad, word in refused:
        with pytest.raises(qp.QuestError, match=word):
            qp.estimate_batch(x1, x2, offsets, K, indices=bad)


def test_scores_are_those_of_their_pair() -> None:
    x1, x2, offsets = pairs(3)
    scores = np.random.default_rng(5).uniform(size=90)
    found = qp.estimate_batch(x1, x2, offsets, K, scores=scores)
    assert found[1] == qp.estimate(x1[30:60], x2[30:60], K, scores=scores[30:60], index=1)
    x1[35] = np.nan
    found = qp.estimate_batch(x1, x2, offsets, K, scores=scores)
    assert found[1] == qp.estimate(x1[30:60], x2[30:60], K, scores=scores[30:60], index=1)
    with pytest.raises(qp.ShapeMismatch, match="scores has 5"):
        qp.estimate_batch(x1, x2, offsets, K, scores=scores[:5])


def test_columns_are_those_of_the_estimates() -> None:
    x1, x2, offsets = pairs(4, planar=True)
    offsets.append(offsets[-1])
    found = qp.estimate_batch(x1, x2, offsets, K)
    assert len(list(found)) == len(found) == 5
    assert found[-1] is None
    with pytest.raises(IndexError, match="pair 5"):
        found[5]
    np.testing.assert_array_equal(found.offsets, offsets)
    for i, estimate in enumerate(found):
        if estimate is None:
            assert np.isnan(found.evidence[i]).all()
            assert found.noise_px[i] == found.parallax[i] == 0
            continue
        assert found.parallax[i] == estimate.parallax
        assert found.noise_px[i] == estimate.noise_px
        np.testing.assert_array_equal(found.evidence[i], list(estimate.evidence.values()))
        other = estimate.runner_up
        if other is None:
            assert np.isnan(found.runner_up_R[i]).all()
            assert np.isnan(found.runner_up_score[i])
        else:
            np.testing.assert_array_equal(found.runner_up_R[i], other.R)
            np.testing.assert_array_equal(found.runner_up_t[i], other.t)
            np.testing.assert_array_equal(found.runner_up_quat_wxyz[i], other.quat_wxyz)
            assert found.runner_up_score[i] == other.score
    assert pickle.loads(pickle.dumps(found)) == found
    text = json.loads(json.dumps(found.to_dict()))
    assert len(text["pairs"]) == 5
    assert "0 matches" in text["pairs"][4]["reason"]
    page = found._repr_html_()
    assert "5 pairs" in page
    assert "found # matches" in page
    assert found[0] is not None
    assert "<table>" in found[0]._repr_html_()


@pytest.mark.parametrize("threads", [1, 2])
def test_progress_is_told_and_can_end_a_batch(threads: int) -> None:
    x1, x2, offsets = pairs(8)
    told: list[tuple[int, int]] = []
    found = qp.estimate_batch(
        x1, x2, offsets, K, num_threads=threads, progress=lambda done, total: told.append((done, total))
    )
    assert found == qp.estimate_batch(x1, x2, offsets, K)
    assert told[-1] == (8, 8)
    assert told == sorted(told)

    class Enough(Exception):
        pass

    def stop(done: int, total: int) -> None:
        raise Enough(f"{done} of {total}")

    with pytest.raises(Enough):
        qp.estimate_batch(x1, x2, offsets, K, num_threads=threads, progress=stop, min_iterations=10_000_000,
                          max_iterations=100_000_000)  # fmt: skip


ENDLESS = """
import sys, threading, os, signal, time
import numpy as np, quest_pose as qp
rng = np.random.default_rng(0)
x1, x2 = rng.uniform(0, 800, (2, 400, 2))
K = np.array([[1000, 0, 400], [0, 1000, 400], [0, 0, 1.0]])
options = dict(min_iterations=10**9, max_iterations=10**9)
# A program that was begun in the background ignores the signal, and so do its children.
signal.signal(signal.SIGINT, signal.default_int_handler)
sent = []
def interrupt():
    sent.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)
threading.Timer(0.5, interrupt).start()
try:
    if sys.argv[1] == "one":
        qp.estimate(x1, x2, K, **options)
    else:
        qp.estimate_batch(x1, x2, range(0, 401, 50), K, num_threads=int(sys.argv[1]), **options)
except KeyboardInterrupt:
    print(time.monotonic() - sent[0])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
@pytest.mark.parametrize("how", ["one", "1", "2"])
def test_control_c_ends_it(how: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", ENDLESS, how], capture_output=True, text=True, timeout=120, env=os.environ, check=True
    )
    # Two tenths of a second on a machine that does nothing else; how loaded this one is, nobody knows.
    assert float(run.stdout) < 5.0


def test_other_containers_go_in_as_they_are() -> None:
    x1, x2, _ = pairs(1)
    expected = qp.estimate(x1, x2, K)
    tried = [x1.tolist()]
    pandas = sys.modules.get("pandas") or _module("pandas")
    polars, torch, pyarrow = _module("polars"), _module("torch"), _module("pyarrow")
    if pandas:
        tried += [pandas.DataFrame(x1, columns=["u", "v"]), pandas.Series(list(x1))]
    if polars:
        tried += [polars.DataFrame(x1, schema=["u", "v"]), polars.Series(x1), polars.Series(x1.tolist())]
    if torch:
        tried += [torch.from_numpy(x1)]
    if pyarrow:
        fixed = pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(x1.ravel()), 2)
        tried += [fixed, pyarrow.chunked_array([fixed[:10], fixed[10:]]), pyarrow.array(x1.tolist())]
    for x in tried:
        assert qp.estimate(x, x2, K) == expected, type(x)


def _module(name: str) -> Any:
    try:
        return __import__(name)
    except ImportError:
        return None


def test_time_is_not_lost_in_small_batches() -> None:
    # A batch of no pairs asks nobody.
    start = time.monotonic()
    assert len(qp.estimate_batch(np.zeros((0, 2)), np.zeros((0, 2)), [0], K)) == 0
    assert time.monotonic() - start < 5
    assert signal.getsignal(signal.SIGINT) is not None
