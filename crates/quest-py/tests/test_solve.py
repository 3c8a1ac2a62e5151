"""Planted poses are found, in whatever way the points are given."""

from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from scenes import Array, K, Scene, make_scene

CAMERA = qp.Camera("PINHOLE", [1060, 1060, 514, 384], width=1024, height=768)


def nearest(candidates: list[qp.Candidate], scene: Scene) -> qp.Candidate:
    return min(candidates, key=lambda c: np.abs(c.R - scene.R).max() + np.abs(c.t - scene.t).max())


def assert_found(candidates: list[qp.Candidate], scene: Scene) -> None:
    best = nearest(candidates, scene)
    np.testing.assert_allclose(best.R, scene.R, atol=1e-6)
    np.testing.assert_allclose(best.t, scene.t, atol=1e-6)
    np.testing.assert_allclose(best.depths1, scene.X1[:, 2], rtol=1e-5)
    np.testing.assert_allclose(best.depths2, scene.X2[:, 2], rtol=1e-5)
    assert best.kind == "exact"
    assert best.feasible
    assert best.in_front == len(scene.X1)
    assert best.residual < 1e-9


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("n", [5, 6, 30])
def test_planted_pose(seed: int, n: int) -> None:
    scene = make_scene(seed, n)
    assert_found(qp.solve(scene.x1, scene.x2), scene)


@pytest.mark.parametrize("solver", [s.name for s in qp.solvers()])
def test_every_solver(solver: str) -> None:
    info = {s.name: s for s in qp.solvers()}[solver]
    scene = make_scene(seed=1, n=max(5, info.min_matches), planar=solver == "homography")
    candidates = qp.solve(scene.x1, scene.x2, solver=solver)
    assert_found(candidates, scene)
    assert len(candidates) <= info.max_candidates
    assert info.min_matches >= 2
    assert info.reference


def test_the_first_solver_is_the_default() -> None:
    scene = make_scene(seed=1)
    assert qp.solve(scene.x1, scene.x2) == qp.solve(scene.x1, scene.x2, solver=qp.solvers()[0].name)


def test_best_first() -> None:
    for seed in range(20):
        scene = make_scene(seed)
        in_front = [c.in_front for c in qp.solve(scene.x1, scene.x2)]
        assert in_front == sorted(in_front, reverse=True)


def test_exact_alone() -> None:
    kinds = set()
    for seed in range(20):
        scene = make_scene(seed)
        every = qp.solve(scene.x1, scene.x2)
        kinds |= {c.kind for c in every}
        assert qp.solve(scene.x1, scene.x2, kinds="exact") == [c for c in every if c.kind == "exact"]
    assert kinds == {"exact", "from_complex", "rotation_only"}


def test_planar_comes_closer_on_planes() -> None:
    errors = {"all": 0.0, "planar": 0.0}
    for seed in range(20):
        scene = make_scene(seed, planar=True)
        x1, x2 = scene.x1.round(3), scene.x2.round(3)
        every = qp.solve(x1, x2)
        with_plane = qp.solve(x1, x2, kinds="planar")
        assert [c for c in with_plane if c.kind != "planar"] == every
        for kinds, found in ("all", every), ("planar", with_plane):
            errors[kinds] += min(float(np.linalg.norm(c.R - scene.R)) for c in found)
    assert errors["planar"] < 0.8 * errors["all"]


@pytest.mark.parametrize(
    "cameras",
    [(CAMERA,), (CAMERA, CAMERA), (K,), (K, CAMERA), (K.tolist(), K.astype(np.float32)), (np.asfortranarray(K),)],
)
def test_pixels(cameras: tuple[Any, ...]) -> None:
    scene = make_scene(seed=1)
    assert_found(qp.solve(scene.u1, scene.u2, *cameras), scene)


def test_two_cameras() -> None:
    scene = make_scene(seed=1)
    assert_found(qp.solve(scene.u1, 500 * scene.x2, K, np.diag([500, 500, 1])), scene)


def test_bearings() -> None:
    scene = make_scene(seed=1)
    # Depths multiply the bearings as given: with the points themselves, all of them are the same.
    candidates = qp.solve(scene.X1, 7 * scene.X2)
    best = min(candidates, key=lambda c: float(np.abs(c.R - scene.R).max()))
    np.testing.assert_allclose(best.R, scene.R, atol=1e-6)
    np.testing.assert_allclose(best.depths1 / best.depths1[0], 1, atol=1e-6)
    np.testing.assert_allclose(best.depths2 / best.depths1[0], 1 / 7, atol=1e-6)


class ArrayLike:
    """What tensors of other libraries look like to NumPy."""

    def __init__(self, array: Array) -> None:
        self.array = array

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return self.array if dtype is None else self.array.astype(dtype)


def misaligned(x: Array) -> Array:
    raw = np.empty(x.nbytes + 1, np.uint8)[1:]
    out: Array = raw.view(np.float64).reshape(x.shape)
    out[...] = x
    assert not out.flags.aligned
    return out


@pytest.mark.parametrize(
    "view",
    [
        np.ndarray.tolist,
        np.asfortranarray,
        lambda x: np.repeat(np.repeat(x, 2, 0), 3, 1)[::2, ::3],
        lambda x: x[::-1].copy()[::-1],
        lambda x: x.T.copy().T,
        lambda x: x.astype(">f8"),
        lambda x: x.astype(np.longdouble),
        misaligned,
        ArrayLike,
        lambda x: [tuple(row) for row in x],
        lambda x: [list(map(np.float64, row)) for row in x],
    ],
)
def test_every_layout(view: Callable[[Array], Any]) -> None:
    scene = make_scene(seed=1)
    x1, x2 = view(scene.x1), view(scene.x2)
    assert qp.solve(x1, x2) == qp.solve(scene.x1, scene.x2)
    np.testing.assert_array_equal(qp.constraint_matrix(x1, x2), qp.constraint_matrix(scene.x1, scene.x2))


@pytest.mark.parametrize("dtype", ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8"])
def test_every_dtype(dtype: str) -> None:
    x = np.random.default_rng(2).integers(0, 100, (2, 6, 2)).astype(dtype)
    expected = qp.constraint_matrix(x[0].astype(np.float64), x[1].astype(np.float64))
    np.testing.assert_array_equal(qp.constraint_matrix(x[0], x[1]), expected)


def test_arguments_are_left_alone() -> None:
    scene = make_scene(seed=1)
    x1, x2 = scene.x1.copy(), scene.x2.copy()
    x1.setflags(write=False)
    qp.solve(x1, x2)
    np.testing.assert_array_equal(x1, scene.x1)
    np.testing.assert_array_equal(x2, scene.x2)


def test_pure_rotation() -> None:
    scene = make_scene(seed=1)
    (candidate,) = qp.solve(scene.X1, scene.X1 @ scene.R.T)
    np.testing.assert_allclose(candidate.R, scene.R, atol=1e-12)
    np.testing.assert_array_equal(candidate.t, 0)
    assert candidate.kind == "rotation_only"
    assert candidate.feasible
    assert not np.isnan(candidate.depths1).any()


@pytest.mark.parametrize(("n", "rows"), [(3, 1), (5, 10), (8, 56)])
def test_constraint_matrix(n: int, rows: int) -> None:
    scene = make_scene(3, n)
    matrix = qp.constraint_matrix(scene.x1, scene.x2)
    assert matrix.shape == (rows, 35)
    assert matrix.dtype == np.float64
    # The monomials of degree four at the true quaternion, from the first component's highest power down.
    q = quaternion(scene.R)
    monomials = [np.prod(c) for c in combinations_with_replacement(q, 4)]
    np.testing.assert_allclose(matrix @ monomials, 0, atol=1e-13)


def quaternion(R: Array) -> Array:
    """Scalar first, by the eigenvector of the symmetric matrix of R (Bar-Itzhack 2000)."""
    k = np.empty((4, 4))
    k[0, 0], k[1:, 1:] = np.trace(R), R + R.T - np.trace(R) * np.eye(3)
    k[0, 1:] = k[1:, 0] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    return np.asarray(np.linalg.eigh(k)[1][:, -1])
