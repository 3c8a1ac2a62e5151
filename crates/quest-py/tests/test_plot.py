"""``Estimate.plot``."""

import sys
from typing import Any

import numpy as np
import pytest
import quest_pose as qp

figures: Any = pytest.importorskip("matplotlib.figure", reason="matplotlib is not installed: pip install matplotlib")
CAMERA = qp.Camera("PINHOLE", [500.0, 500.0, 320.0, 240.0])


@pytest.fixture(scope="module")
def pair() -> Any:
    """Matches of points in space, of which the last ten are wrong, and their estimate."""
    rng = np.random.default_rng(5)
    points = rng.uniform([-1, -0.8, 2], [1, 0.8, 4], (60, 3))
    x1, x2 = CAMERA.project(points), CAMERA.project(points + [0.3, 0.05, 0.1])
    x2[50:] = rng.uniform([0, 0], [640, 480], (10, 2))
    return x1, x2, qp.estimate(x1, x2, CAMERA)


def test_every_match_is_drawn_in_its_colour(pair: Any) -> None:
    x1, x2, found = pair
    figure = found.plot(x1, x2, image1=np.zeros((480, 640), np.uint8), image2=np.zeros((480, 640, 3), np.uint8), figure=figures.Figure())
    left, right, turn, move = figure.axes
    for axes, x in ((left, x1), (right, x2)):
        dots = {line.get_label(): line.get_xydata() for line in axes.lines if "liers" in line.get_label()}
        np.testing.assert_array_equal(dots[f"{found.inlier_count} inliers"], x[found.inliers])
        np.testing.assert_array_equal(dots[f"{60 - found.inlier_count} outliers"], x[~found.inliers])
        assert len(axes.images) == 1 and axes.get_ylim()[0] > axes.get_ylim()[1]
    assert f"{found.inlier_count} of 60 inliers" in figure.get_suptitle()
    for axes, pair_of, unit in ((turn, [0, 1], np.degrees(1.0)), (move, [3, 5], 1.0)):
        ellipse = axes.lines[0].get_xydata()
        inverse = np.linalg.inv(unit**2 * found.covariance[np.ix_(pair_of, pair_of)])
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", ellipse, inverse, ellipse), 5.991, rtol=1e-6)


def test_v_runs_down_without_images_too(pair: Any) -> None:
    x1, x2, found = pair
    left = found.plot(x1, x2, figure=figures.Figure()).axes[0]
    assert left.get_ylim()[0] > left.get_ylim()[1]


def test_other_matches_and_no_matplotlib(pair: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    x1, x2, found = pair
    with pytest.raises(qp.ShapeMismatch, match=r"x2 has the shape \(59, 2\), expected \(60, 2\)"):
        found.plot(x1, x2[:59], figure=figures.Figure())
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        found.plot(x1, x2)
