"""Many samples at once are what each of them is alone."""

import numpy as np
import pytest
import quest_pose as qp
from scenes import Array, make_scene


def samples(count: int) -> tuple[Array, Array]:
    scenes = [make_scene(seed, 5) for seed in range(count)]
    return np.array([s.x1 for s in scenes]), np.array([s.x2 for s in scenes])


def test_planted_poses() -> None:
    x1, x2 = samples(300)
    found = qp.solve_batch(x1, x2)
    assert found.offsets.shape == (301,)
    assert found.R.shape == (len(found.t), 3, 3)
    for b in range(300):
        scene, mine = make_scene(b, 5), found.sample == b
        error = np.abs(found.R[mine] - scene.R).max((1, 2)) + np.abs(found.t[mine] - scene.t).max(1)
        best = error.argmin()
        assert error[best] < 2e-6
        assert found.in_front[mine][best] == 5
        assert found.residual[mine][best] < 1e-9


def test_each_sample_is_solved_as_if_alone() -> None:
    x1, x2 = samples(40)
    x2 = x2 + np.random.default_rng(7).normal(size=x2.shape) * 1e-3
    found = qp.solve_batch(x1, x2)
    for b, (start, end) in enumerate(zip(found.offsets[:-1], found.offsets[1:], strict=True)):
        alone = qp.solve(x1[b], x2[b], kinds="exact")
        assert len(alone) == end - start
        for c in alone:
            near = np.abs(found.R[start:end] - c.R).max((1, 2)) + np.abs(found.t[start:end] - c.t).max(1)
            assert near.min() < 1e-7


def test_bearings_and_no_samples() -> None:
    x1, x2 = samples(3)
    lift = [np.concatenate([x, np.ones((3, 5, 1))], 2) * 3 for x in (x1, x2)]
    np.testing.assert_allclose(qp.solve_batch(*lift).quat_wxyz, qp.solve_batch(x1, x2).quat_wxyz, atol=1e-9)
    empty = qp.solve_batch(np.zeros((0, 5, 2)), np.zeros((0, 5, 2)))
    assert empty.offsets.tolist() == [0]
    assert empty.R.shape == (0, 3, 3)


def test_degenerate_samples_have_no_candidates() -> None:
    x1, x2 = samples(10)
    x1[4], x2[4] = x1[4, :1], x2[4, :1]
    counts = np.diff(qp.solve_batch(x1, x2).offsets)
    assert counts[4] == 0
    assert (np.delete(counts, 4) > 0).all()


def test_bad_input() -> None:
    x1, x2 = samples(10)
    with pytest.raises(qp.ShapeMismatch, match=r"x1 has the shape \(5, 2\), expected .* \(B, 5, 2\)"):
        qp.solve_batch(x1[0], x2)
    with pytest.raises(qp.ShapeMismatch, match="x1 has 10 samples and x2 has 9"):
        qp.solve_batch(x1, x2[:9])
    with pytest.raises(qp.ShapeMismatch, match="two numbers"):
        qp.solve_batch(x1, np.ones((10, 5, 3)))
    x2[7, 3, 1] = np.nan
    with pytest.raises(qp.NotFinite, match="sample 7, match 3: a coordinate in view 2 is NaN"):
        qp.solve_batch(x1, x2)
