"""``GoalImage``: from images to the rows that a controller wants."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quest_pose import _servo_features as features
from quest_pose._core import Camera, QuestError, ShapeMismatch, TooFewMatches

FEWEST = 6
"""A loop never acts on fewer."""

LEAST_COVERAGE = 0.05
"""Below, tilt and translation cannot be told apart within the noise of features."""


class GoalImage:
    """The features of a goal image, and where they are in other images.

    Parameters
    ----------
    image : array_like of uint8
        The goal image: grey of shape (height, width), or BGR of shape (height, width, 3) as OpenCV reads it.
    camera : Camera or array_like of shape (3, 3), optional
        The camera that takes all images; ``Servo`` hands it on.
    detector : {"sift", "orb"} or callable
        ``"sift"`` is the more exact one, ``"orb"`` is the faster one; both need OpenCV. A callable gets the grey image
        and returns points (M, 2) in pixels, strongest first, and descriptors (M, D): uint8 ones are compared bit by
        bit, others by Euclidean distance.
    max_features : int
        So many of the goal's features are kept, spread over the image.
    ratio : float
        A match has to be closer than this times the next best one.
    mask : array_like of bool, shape (height, width), optional
        False where the goal image must not be used: on the gripper, on what will be gone.
    refine : bool, optional
        Whether ``match`` moves its matches to where the goal's patches are, as the method ``refine`` does; this needs OpenCV and
        takes 1 to 10 ms. Where it is not given: for the named detectors, not for a callable.

    Raises
    ------
    ImportError
        Where OpenCV is needed and not installed.
    TooFewMatches
        Where the image has fewer than six features.
    ShapeMismatch, QuestError
        For images of another shape or type, and an unknown detector.

    Warns
    -----
    UserWarning
        Where the features are so close together, or so near to a line, that the pose will be poor.

    Examples
    --------
    >>> import numpy as np
    >>> from quest_pose.servo import GoalImage
    >>> def corners(image):  # a detector of one's own
    ...     v, u = np.nonzero(image)
    ...     return np.stack([u, v], axis=1), image[v, u, None].astype(float)
    >>> image = np.zeros((60, 80), np.uint8)
    >>> image[[10, 12, 30, 31, 50, 55], [10, 70, 35, 60, 20, 75]] = [10, 50, 90, 130, 170, 210]
    >>> goal = GoalImage(image, detector=corners)
    >>> len(goal)
    6
    >>> goal.match(np.roll(image, 3, axis=1))[0] - goal.points[0]
    array([3., 0.])
    """

    def __init__(
        self,
        image: ArrayLike,
        camera: Camera | ArrayLike | None = None,
        *,
        detector: str | features.Detector = "sift",
        max_features: int = 500,
        ratio: float = 0.8,
        mask: ArrayLike | None = None,
        refine: bool | None = None,
    ) -> None:
        if max_features < FEWEST:
            raise QuestError(f"max_features is {max_features}, expected at least {FEWEST}")
        if not 0 < ratio <= 1:
            raise QuestError(f"ratio is {ratio}, expected a number above 0, at most 1")
        self._image = features.grey("image", image)
        self._check_camera(camera)
        self._detector, self._ratio = detector, ratio
        self._refines = isinstance(detector, str) if refine is None else bool(refine)
        # An image from nearer or farther shows other features: several times as many as are kept are looked for.
        self._most = 4 * max_features
        self._detect = features.detector(detector, self._most)
        points, descriptors = features.detect(self._detect, self._image, self._checked_mask(mask))
        places, place = np.unique(points, axis=0, return_inverse=True)
        # SIFT gives a place with several orientations one descriptor each: one row with all of them.
        first = np.full(len(places), len(points))
        np.minimum.at(first, place.ravel(), np.arange(len(points)))
        strongest_first = np.argsort(first)
        kept = strongest_first[features.spread(places[strongest_first], self._image.shape, max_features)]
        if len(kept) < FEWEST:
            name = detector if isinstance(detector, str) else "the detector"
            raise TooFewMatches(
                f"image has {len(kept)} features by {name}, expected at least {FEWEST}: take a goal image with more "
                "texture, sharper, or of more pixels"
            )
        row = np.full(len(places), -1)
        row[kept] = np.arange(len(kept))
        is_kept = row[place.ravel()] >= 0
        self._points = places[kept]
        self._points.setflags(write=False)
        self._place = row[place.ravel()][is_kept]
        self._is_binary = descriptors.dtype == np.uint8
        self._descriptors = features.comparable(descriptors[is_kept])
        if self.coverage < LEAST_COVERAGE:
            warnings.warn(
                f"the features cover {100 * self.coverage:.1f} % of the image, expected at least "
                f"{100 * LEAST_COVERAGE:.0f} %: the pose will be poor",
                stacklevel=2,
            )

    def _check_camera(self, camera: Camera | ArrayLike | None) -> None:
        self._camera = camera
        height, width = self._image.shape
        size = (camera.width, camera.height) if isinstance(camera, Camera) else (None, None)
        if None not in size and size != (width, height):
            raise ShapeMismatch(f"image is {width} x {height}, expected {size[0]} x {size[1]} as the camera")

    def _check_size(self, image: features.Image) -> None:
        if image.shape != self._image.shape:
            found, expected = image.shape[::-1], self._image.shape[::-1]
            raise ShapeMismatch(
                f"image is {found[0]} x {found[1]}, expected {expected[0]} x {expected[1]} as the goal image"
            )

    def _checked_mask(self, mask: ArrayLike | None) -> NDArray[np.bool_] | None:
        if mask is None:
            return None
        checked = np.asarray(mask, bool)
        if checked.shape != self._image.shape:
            raise ShapeMismatch(f"mask has the shape {checked.shape}, expected {self._image.shape} as the goal image")
        return checked

    @property
    def points(self) -> NDArray[np.float64]:
        """(N, 2): the goal's features in pixels, the ``goal`` of a controller. It cannot be written to."""
        return self._points

    @property
    def camera(self) -> Camera | ArrayLike | None:
        """The camera as it was given."""
        return self._camera

    @property
    def image(self) -> features.Image:
        """(height, width): the goal image in grey."""
        return self._image

    @property
    def noise(self) -> float:
        """Pixels: the standard deviation of a matched coordinate that is usual for this detector."""
        if self._refines:
            return features.REFINED_NOISE
        return features.NOISE.get(self._detector, 1.0) if isinstance(self._detector, str) else 1.0

    @property
    def coverage(self) -> float:
        """How much of the image the features cover: 1 where they are everywhere, 0 where they lie on a line."""
        height, width = self._image.shape
        # Even over a rectangle, the variances are its sides squared over 12.
        return float(12 * np.sqrt(max(0.0, np.linalg.det(np.cov(self._points.T)))) / (width * height))

    def match(self, image: ArrayLike, *, mask: ArrayLike | None = None) -> NDArray[np.float64]:
        """Where the goal's features are in another image.

        Parameters
        ----------
        image : array_like of uint8
            An image of the same camera, as the goal's.
        mask : array_like of bool, shape (height, width), optional
            False where the image must not be used: on the gripper.

        Returns
        -------
        numpy.ndarray of shape (N, 2)
            Pixels in the order of ``points``; NaN for features that were not found. Some matches are wrong.

        Raises
        ------
        ShapeMismatch, QuestError
            For an image of another shape or type.
        """
        now = features.grey("image", image)
        self._check_size(now)
        points, descriptors = features.detect(self._detect, now, self._checked_mask(mask))
        rows = np.full(self._points.shape, np.nan)
        if len(points):
            between = features.distances(self._descriptors, features.comparable(descriptors), self._is_binary)
            found_at = features.pairs(between, self._place, points, self._ratio)
            rows[found_at >= 0] = points[found_at[found_at >= 0]]
        return features.refined(self._image, self._points, now, rows)[0] if self._refines else rows

    def refine(self, image: ArrayLike, points: ArrayLike) -> NDArray[np.float64]:
        """Matches of one's own, moved to where the goal's patches are in the image. Needs OpenCV.

        A track that is followed from image to image drifts: on rendered scenes by 1 px in 60 images, and by 3 px in a tenth of the
        tracks, which is enough to end 5 cm beside the goal. Refined by the goal image it is within 0.1 px.

        Parameters
        ----------
        image : array_like of uint8
            The image that ``points`` are from.
        points : array_like of shape (N, 2)
            Pixels in the order of the goal's features, NaN for what is not seen: tracks, or what another matcher found.

        Returns
        -------
        numpy.ndarray of shape (N, 2)
            The refined pixels. A feature whose patch is not found within 4 px stays where it was.

        Raises
        ------
        ImportError
            Where OpenCV is not installed.
        ShapeMismatch, QuestError
            For an image of another shape or type, and another number of points.
        """
        now = features.grey("image", image)
        self._check_size(now)
        rows = np.array(points, float)
        if rows.shape != self._points.shape:
            raise ShapeMismatch(f"points have the shape {rows.shape}, expected {self._points.shape} as the goal's features")
        return features.refined(self._image, self._points, now, rows)[0]

    def depths(self, depth_image: ArrayLike) -> NDArray[np.float64]:
        """The depths of the goal's features in a depth image that was taken with the goal image.

        Parameters
        ----------
        depth_image : array_like of shape (height, width)
            Depths along the optical axis, registered to the goal image; 0 or NaN where there is none.

        Returns
        -------
        numpy.ndarray of shape (N,)
            In the image's unit; NaN where there is none. For ``depths`` of a controller.
        """
        depth = np.asarray(depth_image, float)
        if depth.shape != self._image.shape:
            raise ShapeMismatch(f"depth_image has the shape {depth.shape}, expected {self._image.shape}")
        column, row = np.round(self._points).astype(int).T
        at = depth[row, column]
        return np.where(np.isfinite(at) & (at > 0), at, np.nan)

    def draw(self, image: ArrayLike, points: ArrayLike, used: ArrayLike | None = None) -> features.Image:
        """The image with the features in it: green where the pose rests on them, red where it does not.

        Parameters
        ----------
        image : array_like of uint8
            The image that ``points`` are from.
        points : array_like of shape (N, 2)
            What ``match`` returned.
        used : array_like of bool, shape (N,), optional
            Which of them the pose rests on; all of them where it is not given.

        Returns
        -------
        numpy.ndarray of shape (height, width, 3)
            BGR. Lines lead to where the features are in the goal image. Needs OpenCV.
        """
        cv2 = features.opencv("draw")
        canvas: Any = np.repeat(features.grey("image", image)[..., None], 3, axis=2)
        rows = np.asarray(points, float)
        good = np.ones(len(rows), bool) if used is None else np.asarray(used, bool)
        for now, goal, is_used in zip(rows, self._points, good, strict=True):
            if np.isfinite(now).all():
                here, there = (tuple(int(round(float(x))) for x in p) for p in (now, goal))
                colour = (0, 200, 0) if is_used else (0, 0, 255)
                cv2.line(canvas, here, there, colour, 1, cv2.LINE_AA)
                cv2.circle(canvas, here, 3, colour, 1, cv2.LINE_AA)
        return np.asarray(canvas, np.uint8)

    def __len__(self) -> int:
        return len(self._points)

    def __getstate__(self) -> dict[str, Any]:
        # OpenCV's detectors cannot be pickled; they are made anew.
        return {name: value for name, value in vars(self).items() if name != "_detect"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._points.setflags(write=False)
        self._detect = features.detector(self._detector, self._most)

    def __repr__(self) -> str:
        name = self._detector if isinstance(self._detector, str) else "own"
        return f"<GoalImage {len(self)} features by {name}, {100 * self.coverage:.0f} % covered>"
