"""No input makes it panic, and no answer holds a NaN. A panic is a BaseException, which nothing here catches."""

from typing import Any

import hypothesis.extra.numpy as hnp
import hypothesis.strategies as st
import numpy as np
import quest_pose as qp
from hypothesis import given, settings

# The same cases in every run.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=300)
settings.load_profile("repeatable")

REFUSED = (qp.QuestError, TypeError)

shapes = hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=8)
scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.complex_numbers() | st.text(max_size=3)
anything: st.SearchStrategy[Any] = st.one_of(
    hnp.arrays(hnp.scalar_dtypes(), shapes),
    st.recursive(scalars, lambda inner: st.lists(inner, max_size=4), max_leaves=20),
)
# Few values, so that points coincide, repeat and line up; and those at which arithmetic ends.
numbers = st.sampled_from([0.0, 1.0, -1.0, 0.5, 2.0, 1e-9, 1e-160, 5e-324, 1e154, 6.7e7, np.inf, np.nan]) | st.floats()
matrices = hnp.arrays(np.float64, (3, 3))
views = st.integers(0, 12).flatmap(
    lambda n: st.sampled_from([2, 3]).flatmap(
        lambda d: st.tuples(*[hnp.arrays(np.float64, (n, d), elements=numbers)] * 2)
    )
)
planar = st.lists(st.tuples(*[st.integers(-3, 3)] * 4), min_size=5, max_size=9)


def check(candidates: list[qp.Candidate]) -> None:
    for c in candidates:
        np.testing.assert_allclose(c.R @ c.R.T, np.eye(3), atol=1e-9)
        assert np.isfinite(c.t).all()
        assert np.isfinite(c.residual)
        assert not np.isnan(c.depths1).any()
        assert not np.isnan(c.depths2).any()


@given(anything, anything, st.none() | matrices | anything, st.none() | matrices | anything)
def test_anything(x1: Any, x2: Any, camera1: Any, camera2: Any) -> None:
    try:
        check(qp.solve(x1, x2, camera1, camera2))
    except REFUSED:
        pass


@given(views, st.sampled_from([s.name for s in qp.solvers()]), st.sampled_from(["all", "exact", "planar"]))
def test_extreme_numbers(views: Any, solver: str, kinds: Any) -> None:
    x1, x2 = views
    try:
        check(qp.solve(x1, x2, solver=solver, kinds=kinds))
        assert qp.constraint_matrix(x1, x2).shape[1] == 35
    except REFUSED:
        pass


@given(planar, st.sampled_from([s.name for s in qp.solvers()]))
def test_points_on_a_grid(matches: Any, solver: str) -> None:
    x = np.array(matches) / 4
    try:
        check(qp.solve(x[:, :2], x[:, 2:], solver=solver))
    except REFUSED:
        pass


@given(st.text() | st.sampled_from(["PINHOLE", "RADIAL", "OPENCV"]), anything, st.integers(), st.integers())
def test_cameras(model: str, params: Any, width: int, height: int) -> None:
    try:
        camera = qp.Camera(model, params, width=width, height=height)
        camera.bearing([[0, 0]])
    except (*REFUSED, OverflowError):
        pass


@given(hnp.arrays(np.float64, 8), hnp.arrays(np.float64, (2, 2)), hnp.arrays(np.float64, (2, 3)))
def test_camera_numbers(params: Any, pixels: Any, points: Any) -> None:
    try:
        camera = qp.Camera("OPENCV", params)
        assert np.isfinite(camera.bearing(pixels)).all()
        assert np.isfinite(camera.project(points)).all()
    except REFUSED:
        pass
