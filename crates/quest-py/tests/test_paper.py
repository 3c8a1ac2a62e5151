"""What the package has of the paper beside poses: polynomials, a third view of five points, theorem 2, metrics, scenes."""

import pickle

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import paper
from scenes import Array, rotation


def third_pose(scene: paper.Scene, seed: int) -> tuple[Array, Array, Array]:
    """A third camera beside the others, and the points as it sees them."""
    rng = np.random.default_rng(seed)
    R, t = rotation(rng.uniform(-0.2, 0.2, 3)), rng.uniform(-0.15, 0.15, 3)
    X3 = scene.X1 @ R.T + t
    return R, t, np.asarray(X3[:, :2] / X3[:, 2:])


def test_polynomials_of_the_papers_example_1() -> None:
    monomials = [(4, 0), (3, 1), (2, 2), (1, 3), (0, 4), (0, 0)]
    rows = [[2, 5, 6, 10, 4, 0], [2, 1, -2, 11, 6, 0], [5, 8, 1, 3, 2, -1]]
    as_mappings = [dict(zip(monomials, row, strict=True)) for row in rows]
    as_terms = [[(c, e) for e, c in equation.items()] for equation in as_mappings]
    for equations in as_mappings, as_terms:
        found = qp.solve_polynomials(equations)
        assert found.x.shape == (2, 2)
        assert found.is_real.all()
        # q and -q are one solution.
        ratios = sorted((found.real[:, 1] / found.real[:, 0]).tolist())
        np.testing.assert_allclose(ratios, [-2, -0.5], atol=1e-12)
        np.testing.assert_allclose(np.abs(found.real[:, 0]), 1, atol=1e-12)
        assert found.report["d_bar"] == (6, 6)
        assert found.report["relinearized"]["nullity"] == 2
        assert found.residual.max() < 1e-12
        assert found.at_infinity == 0


def test_polynomials_complex_and_none() -> None:
    found = qp.solve_polynomials([{(2,): 1, (1,): 2, (0,): 2}])
    np.testing.assert_allclose(sorted(found.x[:, 0].imag.tolist()), [-1, 1], atol=1e-12)
    np.testing.assert_allclose(found.x[:, 0].real, -1, atol=1e-12)
    assert found.real.shape == (0, 1)
    # x and -x are one solution where all degrees are even.
    found = qp.solve_polynomials([{(2,): 1, (0,): 1}])
    np.testing.assert_allclose(np.abs(found.x), 1, atol=1e-12)
    assert found.report["grading"] == 2
    none = qp.solve_polynomials([{(1,): 1}, {(1,): 1, (0,): -1}])
    assert none.x.shape == (0, 1)
    assert none.multiplicity.shape == (0,)


def test_polynomials_of_a_pose() -> None:
    scene = paper.scene(seed=3)
    system = paper.constraints(scene.x1, scene.x2)
    exponents = [tuple(_exponent(name, k) for k in range(1, 5)) for name in system.columns]
    equations = [dict(zip(exponents, row, strict=True)) for row in system.C]
    for equation, c in zip(equations, system.c, strict=True):
        equation[0, 0, 0, 0] = -c
    found = qp.solve_polynomials([{e: x for e, x in row.items() if x != 0} for row in equations])
    assert found.report["relinearized"]["nullity"] == 20
    exact = [c for c in qp.solve(scene.x1, scene.x2) if c.kind == "exact"]
    assert exact
    for candidate in exact:
        assert np.abs(found.real @ candidate.quat_wxyz).max() > 1 - 1e-9


def _exponent(name: str, k: int) -> int:
    factors = [f for f in name.split() if f.startswith(f"q{k}")]
    return int((factors[0] + "^1").split("^")[1]) if factors else 0


@pytest.mark.parametrize(
    ("equations", "error", "words"),
    [
        ([], qp.QuestError, "no unknowns"),
        ([{}], qp.QuestError, "no unknowns"),
        ([{(2, 0): 1, (0, 1): 1}], qp.NoAnswer, "not overdetermined enough"),
        ([{(1, 0): 1}, {(1,): 1}], qp.QuestError, "1 exponents"),
        ([{(1,): float("nan")}], qp.QuestError, "finite"),
        ([[(1,)]], qp.QuestError, "equation 0 has the term"),
        ([[(1, [-1])]], qp.QuestError, "whole exponents"),
        ([[(1, [0.5])]], qp.QuestError, "whole exponents"),
        ([{(2, 0): 1, (0, 2): 1, (0, 0): -1}] * 2, qp.NoAnswer, "not isolated"),
    ],
)
def test_polynomials_that_have_no_list(equations: list[object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        qp.solve_polynomials(equations)  # type: ignore[arg-type]


def test_a_third_view_chooses_among_the_poses_of_five_points() -> None:
    for seed in range(50):
        scene = paper.scene(view="in-both-images", seed=seed)
        R, t, x3 = third_pose(scene, seed)
        first, second = qp.solve(scene.x1, scene.x2), qp.solve(scene.x1, x3)
        choice = qp.choose(scene.x1, scene.x2, x3, first, second)
        assert choice is not None
        np.testing.assert_allclose(first[choice.pose_21].R, scene.R, atol=1e-6)
        np.testing.assert_allclose(second[choice.pose_31].R, R, atol=1e-6)
        assert choice.disagreement < 1e-6
        assert choice.disagreement <= choice.next_best
        np.testing.assert_allclose(choice.ratio, np.linalg.norm(t) / np.linalg.norm(scene.t), rtol=1e-3)
        # Poses may be given as they are.
        pairs = [(c.R, c.t) for c in first]
        again = qp.choose(scene.x1, scene.x2, x3, pairs, second)
        assert again is not None
        assert again[:2] == choice[:2]


def test_nothing_to_choose_from() -> None:
    scene = paper.scene(seed=1)
    candidates = qp.solve(scene.x1, scene.x2)
    assert qp.choose(scene.x1, scene.x2, scene.x2, candidates, []) is None
    with pytest.raises(qp.ShapeMismatch):
        qp.choose(scene.x1, scene.x2, scene.x2[:4], candidates, candidates)
    with pytest.raises(qp.QuestError, match=r"poses_31\[0\]\[0\] is not a rotation"):
        qp.choose(scene.x1, scene.x2, scene.x2, candidates, [(2 * np.eye(3), [1, 0, 0])])
    for noise in 0.0, -1.0, float("nan"):
        with pytest.raises(qp.QuestError, match="noise"):
            qp.choose(scene.x1, scene.x2, scene.x2, candidates, candidates, noise=noise)


def test_third_view_of_five_points() -> None:
    right = 0
    for seed in range(20):
        scene = paper.scene(view="in-both-images", seed=100 + seed)
        R, _, x3 = third_pose(scene, seed)
        try:
            found = qp.third_view(scene.x1, scene.x2, x3, threshold=1e-3)
        except qp.NoAnswer:
            continue
        right += np.allclose(found.estimate_21.R, scene.R, atol=1e-6) and np.allclose(found.estimate_31.R, R, atol=1e-6)
    assert right >= 17


@pytest.mark.parametrize("solver", ["quest-literal", "relinearization-literal"])
def test_the_papers_own_steps_have_their_names(solver: str) -> None:
    for seed in range(10):
        scene = paper.scene(seed=seed)
        candidates = qp.solve(scene.x1, scene.x2, solver=solver)
        assert min(float(np.abs(c.R - scene.R).max()) for c in candidates) < 1e-6
    assert {s.name: s.lost for s in qp.solvers()}[solver].endswith("without noise")
    assert not qp.solvers()[0].lost


def test_theorem_2_is_a_choice() -> None:
    kept = {"positive-depth": 0, "theorem-2": 0}
    for seed in range(200):
        scene = paper.scene(view="in-both-images", seed=seed)
        for feasibility in kept:
            every = qp.solve(scene.x1, scene.x2, kinds="exact", feasibility=feasibility)  # type: ignore[arg-type]
            feasible = [c for c in every if c.feasible]
            kept[feasibility] += len(feasible)
            assert min(float(np.abs(c.R - scene.R).max()) for c in feasible) < 1e-5
            assert pickle.loads(pickle.dumps(every)) == every
            assert [c.to_dict()["feasible"] for c in every] == [c.feasible for c in every]
    # Of a thousand scenes the means are 3.08 and 2.29.
    assert 2.0 < kept["theorem-2"] / 200 < 2.6
    assert 2.8 < kept["positive-depth"] / 200 < 3.4
    with pytest.raises(qp.QuestError, match="expected one of positive-depth, theorem-2"):
        qp.solve(scene.x1, scene.x2, feasibility="theorem-3")  # type: ignore[arg-type]


def test_constraints_have_names() -> None:
    scene = paper.scene(points=6, seed=2)
    system = paper.constraints(scene.x1, scene.x2)
    assert system.C.shape == (21, 35)
    assert system.columns[:2] == ["q1^4", "q1^3 q2"]
    assert system.triples.tolist()[:2] == [[0, 1, 2], [0, 1, 3]]
    assert system.triples.shape == (20, 3)
    np.testing.assert_array_equal(system.C[:-1], qp.constraint_matrix(scene.x1, scene.x2))
    candidates = qp.solve(scene.x1, scene.x2)
    q = min(candidates, key=lambda c: float(np.abs(c.R - scene.R).max())).quat_wxyz
    x = [np.prod([q[k - 1] ** _exponent(name, k) for k in range(1, 5)]) for name in system.columns]
    np.testing.assert_allclose(system.C @ x, system.c, atol=1e-9)


def test_translation_and_depths_of_a_rotation() -> None:
    for seed in range(20):
        scene = paper.scene(view="in-both-images", seed=seed)
        found = paper.translation_and_depths(scene.R, scene.x1, scene.x2)
        np.testing.assert_allclose(found.t, scene.t, atol=1e-9)
        np.testing.assert_allclose(found.depths1, scene.X1[:, 2], atol=1e-6)
        assert found.in_front == 5
        assert found.residual < 1e-9
        length = paper.parallax(found.t, found.depths1, found.depths2)
        np.testing.assert_allclose(length, np.linalg.norm(scene.t), atol=1e-9)
    with pytest.raises(qp.TooFewMatches):
        paper.translation_and_depths(scene.R, scene.x1[:1], scene.x2[:1])
    with pytest.raises(qp.QuestError, match="R is not a rotation"):
        paper.translation_and_depths(np.zeros((3, 3)), scene.x1, scene.x2)
    with pytest.raises(qp.ShapeMismatch, match="R has"):
        paper.translation_and_depths(np.eye(4), scene.x1, scene.x2)


def test_metrics() -> None:
    R = rotation(np.array([0.3, 0.1, -0.2]))
    turned = R @ rotation(np.array([0.0, 0.4, 0.0]))
    np.testing.assert_allclose(paper.rotation_metric(R, turned), 0.2, atol=1e-12)
    np.testing.assert_allclose(paper.translation_metric([1, 0, 0], [-5, 5, 0]), np.pi / 4)
    assert paper.translation_metric([0, 0, 0], [1, 2, 3]) == 0
    assert paper.parallax([0.0, 0.3, 0.4], [1, 2], [-1, 2]) == pytest.approx(0.5 / 1.5)
    with pytest.raises(qp.QuestError, match="no mean"):
        paper.parallax([1, 0, 0], [], [])
    with pytest.raises(qp.QuestError, match="R_est is not a rotation"):
        paper.rotation_metric(R, np.eye(3) * -1)


def test_scenes_are_those_of_their_arguments() -> None:
    scene = paper.scene(points=7, parallax=0.05, seed=9)
    assert scene.x1.shape == (7, 2)
    np.testing.assert_allclose(np.linalg.norm(scene.t), 0.05)
    X2 = scene.X1 @ scene.R.T + scene.t
    np.testing.assert_allclose(scene.x2, X2[:, :2] / X2[:, 2:], atol=1e-9)
    np.testing.assert_allclose(np.mean(np.abs([scene.X1[:, 2], X2[:, 2]])), 1)
    again = paper.scene(points=7, parallax=0.05, seed=9)
    np.testing.assert_array_equal(scene.x2, again.x2)
    assert np.abs(paper.scene(points=7, parallax=0.05, seed=9, noise_px=1).x2 - scene.x2).max() > 0
    np.testing.assert_array_equal(paper.scene(motion="rotation").t, 0)
    np.testing.assert_array_equal(paper.scene(motion="translation").R, np.eye(3))
    box = [[-1, 1], [-1, 1], [50, 60]]
    far = paper.scene(points=20, points_box=box, translation_box=[0, 0, 2])
    assert (np.abs(far.x1) < 1 / 50).all()
    np.testing.assert_array_equal(far.t[:2], 0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"layout": "ring"}, "expected one of general, coplanar"),
        ({"motion": "jump"}, "expected one of general, rotation, translation"),
        ({"motion": "rotation", "parallax": 0.1}, "motion=\"general\""),
        ({"view": "some"}, "expected one of everywhere"),
        ({"parallax": 2.0}, "from 0 to 1"),
        ({"points": 0}, "at least 1"),
        ({"points_box": [[1, 0], [0, 1], [2, 4]]}, "box of the points"),
        ({"points_box": [1, 2, 3]}, "points_box has the shape"),
        ({"translation_box": [0, 0, 0]}, "box of the translations"),
        ({"noise_px": float("nan")}, "noise"),
    ],
)
def test_impossible_scenes_are_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(qp.QuestError, match=words):
        paper.scene(**arguments)  # type: ignore[arg-type]
