"""Bad input is an error that says what was found and what was expected."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from scenes import K, make_scene

SCENE = make_scene(seed=1)
X1, X2 = SCENE.x1, SCENE.x2
POINTS = "real numbers of shape (N, 2) or (N, 3)"

# Four of the five points stand on a line in space.
ON_LINE = np.array([[-0.6, 0.2, 4.0], [-0.2, 0.1, 4.2], [0.2, 0.0, 4.4], [0.6, -0.1, 4.6], [0.3, 0.8, 3.5]])
LINE = ON_LINE, ON_LINE @ SCENE.R.T + SCENE.t
BARREL = qp.Camera("SIMPLE_RADIAL", [500, 320, 240, -0.2])


def with_value(value: float) -> Any:
    x = X1.copy()
    x[3, 1] = value
    return x


CASES: list[tuple[Callable[[], object], type[Exception], list[str]]] = [
    (lambda: qp.solve(X1[:4], X2[:4]), qp.TooFewMatches, ["4", "5"]),
    (lambda: qp.solve(X1[:0], X2[:0]), qp.TooFewMatches, ["0", "5"]),
    (lambda: qp.constraint_matrix(X1[:2], X2[:2]), qp.TooFewMatches, ["2", "3"]),
    (lambda: qp.solve(with_value(np.nan), X2), qp.NotFinite, ["match 3", "view 1", "NaN", "finite"]),
    (lambda: qp.solve(X2, with_value(-np.inf)), qp.NotFinite, ["match 3", "view 2", "-inf"]),
    (lambda: qp.solve(with_value(np.nan), SCENE.u2, K), qp.NotFinite, ["match 3", "view 1", "NaN"]),
    (lambda: qp.solve(np.ma.masked_less(X1, 0), X2), qp.NotFinite, ["x1", "masked", POINTS]),
    (lambda: qp.solve(X1, X2[:4]), qp.ShapeMismatch, ["view 1", "5", "view 2", "4"]),
    (lambda: qp.solve(X1.T, X2.T), qp.ShapeMismatch, ["x1", "(2, 5)", POINTS]),
    (lambda: qp.solve(X1, X2[:, :1]), qp.ShapeMismatch, ["x2", "(5, 1)", POINTS]),
    (lambda: qp.solve(X1[:, None], X2[:, None]), qp.ShapeMismatch, ["(5, 1, 2)", POINTS]),
    (lambda: qp.solve([], []), qp.ShapeMismatch, ["(0,)", POINTS]),
    (lambda: qp.solve(1.0, 2.0), qp.ShapeMismatch, ["()", POINTS]),
    (lambda: qp.solve([[1, 2], [3]], X2), qp.ShapeMismatch, ["x1", "inhomogeneous", POINTS]),
    (lambda: qp.solve(SCENE.X1, X2), qp.ShapeMismatch, ["x1 has 3 columns and x2 has 2"]),
    (lambda: qp.solve(SCENE.X1, SCENE.X2, K), qp.ShapeMismatch, ["(N, 3)", "(N, 2)", "cameras"]),
    (lambda: qp.solve(X1, X2, K[:2]), qp.ShapeMismatch, ["camera1", "(2, 3)", "Camera", "(3, 3)"]),
    (lambda: qp.solve(X1, X2, K, K[:, :2]), qp.ShapeMismatch, ["camera2", "(3, 2)", "Camera", "(3, 3)"]),
    (lambda: qp.solve(X1 * 1j, X2), TypeError, ["x1", "complex128", POINTS]),
    (lambda: qp.solve(X1, X2.astype(str)), TypeError, ["x2", "<U", POINTS]),
    (lambda: qp.solve(X1.astype(object), X2), TypeError, ["x1", "object", POINTS]),
    (lambda: qp.solve(X1.astype("m8[s]"), X2), TypeError, ["x1", "timedelta64", POINTS]),
    (lambda: qp.solve(X1, X2, "PINHOLE"), TypeError, ["camera1", "<U7", "Camera", "(3, 3)"]),
    (lambda: qp.solve(X1, X2, seed=1), TypeError, ["seed"]),  # type: ignore[call-arg]
    (lambda: qp.solve(X1, X2, K, K, "quest-eigen"), TypeError, ["positional"]),  # type: ignore[call-arg]
    (lambda: qp.solve(X1, X2, camera2=K), qp.BadCamera, ["camera2", "camera1"]),
    (lambda: qp.solve(X1, X2, -K), qp.BadCamera, ["camera1", "-1"]),
    (lambda: qp.solve(X1, X2, K, np.full((3, 3), np.nan)), qp.BadCamera, ["camera2", "NaN"]),
    (lambda: qp.solve(X1, X2, solver="orb"), qp.QuestError, ["orb", *(s.name for s in qp.solvers())]),
    (lambda: qp.estimate(X1, X2, threshold=1, loss="huber"), qp.QuestError, ["huber", "marginalised", "truncated"]),  # type: ignore[arg-type]
    (lambda: qp.solve(X1, X2, kinds="real"), qp.QuestError, ["real", "all", "exact", "planar"]),  # type: ignore[arg-type]
    (lambda: qp.solve(with_value(1e9), X2), qp.DegenerateInput, ["match 3", "view 1", "1e9"]),
    (lambda: qp.solve(SCENE.X1 * 0, SCENE.X2), qp.DegenerateInput, ["match 0", "view 1", "length"]),
    (lambda: qp.solve(X1 * 0, X2), qp.DegenerateInput, ["coincide"]),
    (lambda: qp.solve(X1[[0, 1, 2, 3, 3]], X2[[0, 1, 2, 3, 3]]), qp.DegenerateInput, ["repeated"]),
    (lambda: qp.solve(*LINE), qp.DegenerateInput, ["line"]),
    (lambda: qp.Camera("PINHOLE", [1, 2, 3]), qp.BadCamera, ["PINHOLE", "4", "3"]),
    (lambda: qp.Camera("PINHOLE", [1, 0, 3, 4]), qp.BadCamera, ["fy", "0"]),
    (lambda: qp.Camera("PINHOLE", [1, np.nan, 3, 4]), qp.BadCamera, ["fy", "NaN"]),
    (lambda: qp.Camera("pinhole", [1, 1, 3, 4]), qp.BadCamera, ["pinhole", "PINHOLE", "FULL_OPENCV"]),
    (lambda: qp.Camera("PINHOLE", K), qp.ShapeMismatch, ["params", "(3, 3)", "(N,)"]),
    (lambda: qp.Camera("PINHOLE", [1, 1, 3, 4], width=640), qp.BadCamera, ["width", "height"]),
    (lambda: qp.Camera("PINHOLE", [1, 1, 3, 4], width=0, height=1), qp.BadCamera, ["0 x 1"]),
    (lambda: qp.Camera.from_k(2 * K), qp.BadCamera, ["(2, 2)", "2", "1"]),
    (lambda: qp.Camera.from_k(K).bearing(np.array([[0, 0], [np.inf, 0]])), qp.NotFinite, ["pixel 1", "inf"]),
    (lambda: qp.Camera.from_k(K).bearing(K), qp.ShapeMismatch, ["pixels", "(3, 3)", "(N, 2)"]),
    (lambda: qp.Camera.from_k(K).project([[0, 0, 1], [0, 0, -1]]), qp.BadCamera, ["point 1", "-1"]),
    (lambda: BARREL.bearing([[1e6, 0]]), qp.BadCamera, ["pixel 0"]),
    (lambda: qp.solve(1e6 * X1, SCENE.u2, BARREL), qp.BadCamera, ["match 0", "view 1"]),
]

@pytest.mark.parametrize(("call", "error", "words"), CASES)
def test_error(call: Callable[[], object], error: type[Exception], words: list[str]) -> None:
    with pytest.raises(error) as caught:
        call()
    assert type(caught.value) is error
    message = str(caught.value)
    for word in words:
        assert word in message


def test_too_many_rows_for_the_memory() -> None:
    x = np.zeros((500_000, 2))
    with pytest.raises(MemoryError, match="500000 matches make 20833208333500000 rows"):
        qp.constraint_matrix(x, x)


def test_errors_of_the_array_itself_pass() -> None:
    class Broken:
        def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
            raise RuntimeError("on another device")

    with pytest.raises(RuntimeError, match="on another device"):
        qp.solve(Broken(), X2)


CLASSES = [qp.TooFewMatches, qp.NotFinite, qp.ShapeMismatch, qp.DegenerateInput, qp.BadCamera]


@pytest.mark.parametrize("error", CLASSES)
def test_classes(error: type[qp.QuestError]) -> None:
    assert issubclass(error, qp.QuestError)
    assert issubclass(error, ValueError)
    assert error.__module__ == "quest_pose"
    assert error.__doc__
    copy = pickle.loads(pickle.dumps(error("why")))
    assert type(copy) is error
    assert str(copy) == "why"
