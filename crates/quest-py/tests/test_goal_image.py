"""``GoalImage`` and ``Servo``: from images to rows, and to commands."""

import doctest
import pickle
import sys
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from quest_pose import _servo_features as features
from quest_pose import _servo_goal
from quest_pose.servo import GoalImage, RobotServo, Servo
from rendered import CAMERA, DENSITY, GENERAL, HEIGHT, PLANAR, WIDTH, World
from scenes import Array, rotation

cv2 = features.opencv("this test")
REST = np.eye(3), np.zeros(3)
MOVED = rotation(np.array([0.05, -0.1, 0.3])), np.array([0.08, -0.05, 0.1])


@pytest.fixture(scope="module")
def plane() -> World:
    return World(PLANAR)


@pytest.fixture(scope="module")
def goal(plane: World) -> GoalImage:
    return GoalImage(plane.image(*REST), CAMERA)


def moved(points: Array, world: World) -> Array:
    """Where the features of a plane are after MOVED."""
    H = world.homography(0, *MOVED) @ np.linalg.inv(world.homography(0, *REST))
    there = np.c_[points, np.ones(len(points))] @ H.T
    return np.asarray(there[:, :2] / there[:, 2:])


def test_examples() -> None:
    result = doctest.testmod(_servo_goal)
    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.parametrize("name", ["sift", "orb"])
def test_matches_lie_where_the_camera_moved_them(name: str, plane: World) -> None:
    goal = GoalImage(plane.image(*REST), CAMERA, detector=name)
    found = goal.match(plane.image(*MOVED))
    error = np.linalg.norm(found - moved(goal.points, plane), axis=1)
    matched = np.isfinite(error)
    assert found.shape == goal.points.shape
    assert matched.sum() >= 60
    assert (error[matched] < 3).mean() > 0.85
    # The distance of two independent coordinates has the median 1.18 sigma.
    assert np.median(error[matched]) < 1.18 * 1.3 * goal.noise
    outside = (moved(goal.points, plane) < -3).any(axis=1)
    assert outside.any() and (error[outside & matched] > 3).all()


def test_refined_matches_do_not_drift(plane: World) -> None:
    goal = GoalImage(plane.image(*REST), CAMERA, refine=False)
    truth, image = moved(goal.points, plane), plane.image(*MOVED)
    rng = np.random.default_rng(22)
    # Tracks that have drifted, a few lost ones, and one that is wrong.
    drifted = truth + rng.normal(0, 1.0, truth.shape)
    drifted[(truth < 12).any(axis=1) | (truth > [WIDTH - 13, HEIGHT - 13]).any(axis=1)] = np.nan
    seen = np.isfinite(drifted[:, 0])
    wrong = np.flatnonzero(seen)[0]
    drifted[wrong] += 40
    refined = goal.refine(image, drifted)
    error = np.linalg.norm(refined - truth, axis=1)
    np.testing.assert_array_equal(np.isfinite(refined[:, 0]), seen)
    np.testing.assert_array_equal(np.linalg.norm(refined - drifted, axis=1)[seen] < 4, True)
    assert error[wrong] > 30
    assert np.median(error[seen]) < 0.2 < np.median(np.linalg.norm(drifted - truth, axis=1)[seen])
    # What cannot be refined is left.
    few = np.full(drifted.shape, np.nan)
    few[:3] = 10.0, 20.0
    np.testing.assert_array_equal(goal.refine(image, few), few)
    with pytest.raises(qp.ShapeMismatch, match="points have the shape"):
        goal.refine(image, drifted[:-1])


def test_named_detectors_refine_and_own_ones_are_asked(plane: World) -> None:
    image = plane.image(*REST)
    assert GoalImage(image, CAMERA, detector="orb").noise == features.REFINED_NOISE
    assert GoalImage(image, CAMERA, detector="orb", refine=False).noise == features.NOISE["orb"]
    own = GoalImage(image, CAMERA, detector=features.detector("orb", 500))
    refined = GoalImage(image, CAMERA, detector=features.detector("orb", 500), refine=True)
    assert own.noise == 1.0 and refined.noise == features.REFINED_NOISE
    error = [np.linalg.norm(g.match(plane.image(*MOVED)) - moved(g.points, plane), axis=1) for g in (own, refined)]
    assert np.nanmedian(error[1]) < 0.5 * np.nanmedian(error[0])


def test_colour_and_grey_are_the_same(goal: GoalImage, plane: World) -> None:
    now = plane.image(*MOVED)
    rows = goal.match(now)
    for other in (now[..., None], np.repeat(now[..., None], 3, 2), np.repeat(now[..., None], 4, 2), now.tolist()):
        np.testing.assert_array_equal(goal.match(np.asarray(other, np.uint8)), rows)
    wide = np.zeros((HEIGHT, 2 * WIDTH), np.uint8)
    wide[:, ::2] = now
    np.testing.assert_array_equal(goal.match(wide[:, ::2]), rows)


def test_masks_are_kept_out(plane: World) -> None:
    right = np.zeros((HEIGHT, WIDTH), bool)
    right[:, WIDTH // 2 :] = True
    goal = GoalImage(plane.image(*REST), CAMERA, mask=right)
    assert (goal.points[:, 0] >= WIDTH // 2 - 0.5).all()
    assert np.isfinite(goal.match(plane.image(*REST))).any()
    found = goal.match(plane.image(*REST), mask=~right)
    assert not (found[:, 0] > WIDTH / 2).any()


def test_a_strong_corner_does_not_take_all_features(plane: World) -> None:
    image = plane.image(*REST)
    image[:, WIDTH // 3 :] = (0.25 * image[:, WIDTH // 3 :] + 90).astype(np.uint8)
    strongest = np.array([k.pt for k in cv2.ORB_create(nfeatures=100, fastThreshold=10).detect(image)])
    assert 12 * np.sqrt(np.linalg.det(np.cov(strongest.T))) / (WIDTH * HEIGHT) < 0.25
    assert GoalImage(image, detector="orb", max_features=100).coverage > 0.4


def test_features_of_a_patch_are_warned_of(plane: World) -> None:
    patch = np.zeros((HEIGHT, WIDTH), bool)
    patch[100:150, 100:150] = True
    with pytest.warns(UserWarning, match=r"cover \d\.\d % of the image"):
        GoalImage(plane.image(*REST), mask=patch)


def test_depths_are_those_of_the_places(goal: GoalImage) -> None:
    depth = np.tile(np.arange(WIDTH, dtype=np.uint16), (HEIGHT, 1))
    depth[:, :100] = 0
    depths = goal.depths(depth)
    left = np.round(goal.points[:, 0]) < 100
    assert np.isnan(depths[left]).all() and left.any()
    np.testing.assert_array_equal(depths[~left], np.round(goal.points[~left, 0]))


def test_drawn_features_are_seen(goal: GoalImage, plane: World) -> None:
    now = plane.image(*MOVED)
    rows = goal.match(now)
    used = np.arange(len(goal)) % 2 == 0
    drawn = goal.draw(now, rows, used)
    assert drawn.shape == (HEIGHT, WIDTH, 3)
    for colour in ([0, 200, 0], [0, 0, 255]):
        assert (drawn == colour).all(axis=2).any()


def test_pickled_it_matches_alike(goal: GoalImage, plane: World) -> None:
    again = pickle.loads(pickle.dumps(goal))
    now = plane.image(*MOVED)
    np.testing.assert_array_equal(again.match(now), goal.match(now))
    with pytest.raises(ValueError, match="read-only"):
        again.points[0] = 0


def bits(image: Any) -> tuple[Array, Any]:
    """ORB without its wrapper: a detector of the user's own with binary descriptors."""
    keypoints, descriptors = cv2.ORB_create(nfeatures=400).detectAndCompute(image, None)
    return np.array([[k.pt] for k in keypoints]), descriptors


def test_a_detector_of_one_s_own(plane: World, monkeypatch: pytest.MonkeyPatch) -> None:
    image = plane.image(*REST)
    goal = GoalImage(image, detector=bits)
    assert np.isfinite(goal.match(plane.image(*MOVED))[:, 0]).sum() > 40
    monkeypatch.setitem(sys.modules, "cv2", None)
    assert len(GoalImage(image, detector=bits)) == len(goal)
    with pytest.raises(ImportError, match="pip install opencv-python-headless"):
        GoalImage(goal.image)


def test_the_ratio_looks_at_other_places_only() -> None:
    place = np.array([0, 1])
    between = np.array([[1.0, 1.1, 9.0], [9.0, 9.0, 2.0]], np.float32)
    close = np.array([[10.0, 10.0], [11.0, 10.0], [50.0, 50.0]])
    np.testing.assert_array_equal(features.pairs(between, place, close, 0.8), [0, 2])
    far = close + [[0, 0], [40, 0], [0, 0]]
    np.testing.assert_array_equal(features.pairs(between, place, far, 0.8), [-1, 2])
    # Both places like keypoint 0; it is the other's.
    rivals = np.array([[1.0, 9.0, 9.0], [0.5, 9.0, 9.0]], np.float32)
    np.testing.assert_array_equal(features.pairs(rivals, place, far, 0.8), [-1, 0])


def test_binary_distances_are_hamming_s() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, 256, (5, 32), np.uint8), rng.integers(0, 256, (7, 32), np.uint8)
    found = features.distances(features.comparable(a), features.comparable(b), True)
    expected = np.unpackbits(a[:, None] ^ b[None], axis=2).sum(2)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"image": np.zeros((240, 320))}, qp.QuestError, "float64, expected an image of uint8"),
        ({"image": np.zeros((240, 320, 2), np.uint8)}, qp.ShapeMismatch, r"\(240, 320, 2\), expected"),
        ({"image": np.zeros((0, 320), np.uint8)}, qp.ShapeMismatch, r"\(0, 320\), expected"),
        ({"image": np.zeros((240, 320), np.uint8)}, qp.TooFewMatches, "0 features by sift, expected at least 6"),
        ({"image": np.zeros((200, 320), np.uint8)}, qp.ShapeMismatch, "320 x 200, expected 320 x 240 as the camera"),
        ({"detector": "surf"}, qp.QuestError, '\'surf\', expected "sift", "orb", or a callable'),
        ({"detector": lambda _: (np.zeros((3, 2)), np.zeros((2, 8)))}, qp.ShapeMismatch, "one row of descriptors a point"),
        ({"mask": np.ones((2, 2))}, qp.ShapeMismatch, r"mask has the shape \(2, 2\)"),
        ({"ratio": 1.5}, qp.QuestError, "ratio is 1.5"),
        ({"max_features": 5}, qp.QuestError, "max_features is 5, expected at least 6"),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], error: type[Exception], words: str, goal: GoalImage) -> None:
    with pytest.raises(error, match=words):
        GoalImage(**{"image": goal.image, "camera": CAMERA, **arguments})


def test_images_of_another_size_are_refused(goal: GoalImage) -> None:
    with pytest.raises(qp.ShapeMismatch, match="160 x 120, expected 320 x 240 as the goal image"):
        goal.match(np.zeros((120, 160), np.uint8))
    assert np.isnan(goal.match(np.zeros((240, 320), np.uint8))).all()


LIMITS: dict[str, Any] = {"max_speed": 0.2, "max_turn_rate": 0.4, "unit": 1.1}


def test_matches_are_taken_in_all_shapes(goal: GoalImage, plane: World) -> None:
    now = plane.image(*MOVED)
    rows = goal.match(now)
    shapes = [now, rows, rows[:, None], [None if np.isnan(p[0]) else tuple(p) for p in rows]]
    servos = [Servo(goal, **LIMITS) for _ in shapes]
    for _ in range(15):
        commands = [servo.step(seen) for servo, seen in zip(servos, shapes, strict=True)]
        for servo, command in zip(servos, commands, strict=True):
            np.testing.assert_array_equal(servo.points, rows)
            np.testing.assert_array_equal(command.angular, commands[0].angular)
            assert command.state == commands[0].state
    with pytest.raises(qp.ShapeMismatch, match=r"matches have the shape \(3, 2\), expected"):
        servos[0].step(rows[:3])
    with pytest.raises(qp.ShapeMismatch, match="other than two coordinates"):
        servos[0].step([(1.0, 2.0, 3.0)] * len(goal))


def test_points_are_for_the_controllers(goal: GoalImage) -> None:
    points: Any = goal.points
    with pytest.raises(qp.QuestError, match="a ndarray, expected a GoalImage; RobotServo takes points"):
        Servo(points, RobotServo, **LIMITS)


assert DENSITY > 290 / 0.8, "the textures are finer than the images of the nearest rectangle"
