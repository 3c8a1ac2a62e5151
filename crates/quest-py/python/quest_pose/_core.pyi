from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, Literal, TypeAlias, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import NotRequired, Unpack, disjoint_base

from quest_pose._options import EstimateOptions

__all__ = [
    "BadCamera",
    "Camera",
    "CameraServo",
    "Candidate",
    "Command",
    "Controller",
    "DegenerateInput",
    "Estimate",
    "EstimateBatch",
    "NoAnswer",
    "NoPose",
    "NotFinite",
    "QuestError",
    "RelativePose",
    "RobotServo",
    "RunnerUp",
    "ShapeMismatch",
    "TooFewMatches",
    "__version__",
    "_candidate",
    "_choose",
    "_colmap_export",
    "_colmap_read_pairs",
    "_colmap_verify",
    "_colmap_write",
    "_columns",
    "_command",
    "_estimate",
    "_estimate_batch",
    "_parallax",
    "_rotation_metric",
    "_runner_up",
    "_scene",
    "_solve_batch",
    "_solve_polynomials",
    "_solvers",
    "_third_view",
    "_translation_and_depths",
    "_translation_metric",
    "constraint_matrix",
    "estimate",
    "estimate_batch",
    "joint_velocities",
    "solve",
]

__version__: str

_Array: TypeAlias = NDArray[np.float64]
_Bools: TypeAlias = NDArray[np.bool_]
_Counts: TypeAlias = NDArray[np.uint64]
_Kind: TypeAlias = Literal["exact", "from_complex", "rotation_only", "planar"]
_Model: TypeAlias = Literal["general", "planar", "pure_rotation"]
_Invalid: TypeAlias = Literal["outlier", "pair", "raise"]
_Convention: TypeAlias = Literal["additive", "gtsam", "se3_left", "se3_right"]
_Names: TypeAlias = list[tuple[str, str]]
_Path: TypeAlias = str | PathLike[str]
# A Camera, a matrix K, a mapping, or a camera of another library by its attributes.
_AnyCamera: TypeAlias = Any

class QuestError(ValueError): ...
class NoAnswer(QuestError): ...
class TooFewMatches(NoAnswer): ...
class NotFinite(QuestError): ...
class ShapeMismatch(QuestError): ...
class DegenerateInput(NoAnswer): ...
class BadCamera(QuestError): ...
class NoPose(NoAnswer): ...

@final
class Camera:
    def __new__(
        cls, model: str, params: ArrayLike, *, width: int | None = None, height: int | None = None
    ) -> Camera: ...
    @staticmethod
    def from_k(k: ArrayLike, /) -> Camera: ...
    @staticmethod
    def from_opencv(
        k: ArrayLike, dist: ArrayLike | None = None, *, fisheye: bool = False, size: tuple[int, int] | None = None
    ) -> Camera: ...
    @property
    def model(self) -> str: ...
    @property
    def params(self) -> tuple[float, ...]: ...
    @property
    def width(self) -> int | None: ...
    @property
    def height(self) -> int | None: ...
    def bearing(self, pixels: ArrayLike, /, *, invalid: Literal["raise", "nan"] = "raise") -> _Array: ...
    def has_ray(self, pixels: ArrayLike, /) -> _Bools: ...
    def project(self, points: ArrayLike, /) -> _Array: ...
    def to_dict(self) -> dict[str, Any]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __getnewargs_ex__(self) -> tuple[tuple[str, Sequence[float]], dict[str, int | None]]: ...

@disjoint_base
class RelativePose:
    @property
    def R(self) -> _Array: ...
    @property
    def t(self) -> _Array: ...
    @property
    def quat_wxyz(self) -> _Array: ...
    @property
    def quat_xyzw(self) -> _Array: ...
    @property
    def parallax(self) -> float: ...
    @property
    def E(self) -> _Array: ...
    def matrix(self) -> _Array: ...
    def fundamental(self, camera1: _AnyCamera, camera2: _AnyCamera = None) -> _Array: ...

@type_check_only
class _CandidateDict(TypedDict):
    kind: _Kind
    q_21: list[float]
    R_21: list[list[float]]
    t_21: list[float]
    depths1: list[float | None]
    depths2: list[float | None]
    residual: float
    in_front: int
    feasible: bool

@final
class Candidate(RelativePose):
    @property
    def kind(self) -> _Kind: ...
    @property
    def depths1(self) -> _Array: ...
    @property
    def depths2(self) -> _Array: ...
    @property
    def residual(self) -> float: ...
    @property
    def in_front(self) -> int: ...
    @property
    def feasible(self) -> bool: ...
    def to_dict(self) -> _CandidateDict: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> tuple[Any, ...]: ...

def solve(
    x1: ArrayLike,
    x2: ArrayLike,
    camera1: _AnyCamera = None,
    camera2: _AnyCamera = None,
    *,
    solver: str | None = None,
    kinds: Literal["all", "exact", "planar"] = "all",
    feasibility: Literal["positive-depth", "theorem-2"] = "positive-depth",
) -> list[Candidate]: ...
@type_check_only
class _RunnerUpDict(TypedDict):
    q_21: list[float]
    R_21: list[list[float]]
    t_21: list[float]
    parallax: float
    score: float
    inlier_count: int

@type_check_only
class _EstimateDict(_RunnerUpDict):
    model: _Model
    invalid_count: NotRequired[int]
    covariance: list[list[float]]
    inliers: list[bool]
    iterations: int
    runner_up: _RunnerUpDict | None
    evidence: dict[str, float | None]
    noise_px: float
    normal: list[float] | None
    false_share: float
    unmoved: int

@final
class RunnerUp(RelativePose):
    @property
    def score(self) -> float: ...
    @property
    def inlier_count(self) -> int: ...
    def to_dict(self) -> _RunnerUpDict: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Estimate(RelativePose):
    @property
    def model(self) -> _Model: ...
    @property
    def covariance(self) -> _Array: ...
    @property
    def inliers(self) -> _Bools: ...
    @property
    def inlier_count(self) -> int: ...
    @property
    def score(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def runner_up(self) -> RunnerUp | None: ...
    @property
    def evidence(self) -> dict[str, float]: ...
    @property
    def noise_px(self) -> float: ...
    @property
    def invalid_count(self) -> int: ...
    @property
    def normal(self) -> _Array | None: ...
    @property
    def false_share(self) -> float: ...
    @property
    def unmoved(self) -> int: ...
    @property
    def inlier_ratio(self) -> float: ...
    def points(
        self, x1: ArrayLike, x2: ArrayLike, camera1: _AnyCamera = None, camera2: _AnyCamera = None
    ) -> _Array: ...
    def depths(
        self, x1: ArrayLike, x2: ArrayLike, camera1: _AnyCamera = None, camera2: _AnyCamera = None
    ) -> _Array: ...
    def covariance_as(self, convention: _Convention, /) -> _Array: ...
    def plot(
        self,
        x1: ArrayLike,
        x2: ArrayLike,
        *,
        image1: ArrayLike | None = None,
        image2: ArrayLike | None = None,
        figure: Any = None,
    ) -> Any: ...
    def _repr_html_(self) -> str: ...
    def to_dict(self) -> _EstimateDict: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class EstimateBatch:
    @property
    def model(self) -> list[_Model | None]: ...
    @property
    def reason(self) -> list[str | None]: ...
    @property
    def found(self) -> _Bools: ...
    @property
    def R(self) -> _Array: ...
    @property
    def t(self) -> _Array: ...
    @property
    def quat_wxyz(self) -> _Array: ...
    @property
    def covariance(self) -> _Array: ...
    @property
    def inliers(self) -> _Bools: ...
    @property
    def inlier_count(self) -> _Counts: ...
    @property
    def score(self) -> _Array: ...
    @property
    def iterations(self) -> _Counts: ...
    @property
    def offsets(self) -> _Counts: ...
    @property
    def invalid_count(self) -> _Counts: ...
    @property
    def parallax(self) -> _Array: ...
    @property
    def noise_px(self) -> _Array: ...
    @property
    def normal(self) -> _Array: ...
    @property
    def false_share(self) -> _Array: ...
    @property
    def unmoved(self) -> _Counts: ...
    @property
    def evidence(self) -> _Array: ...
    @property
    def runner_up_R(self) -> _Array: ...
    @property
    def runner_up_quat_wxyz(self) -> _Array: ...
    @property
    def runner_up_t(self) -> _Array: ...
    @property
    def runner_up_score(self) -> _Array: ...
    def to_dict(self) -> dict[str, Any]: ...
    def _repr_html_(self) -> str: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> Estimate | None: ...
    def __iter__(self) -> Iterator[Estimate | None]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> tuple[Any, ...]: ...

def estimate(
    x1: ArrayLike,
    x2: ArrayLike,
    camera1: _AnyCamera = None,
    camera2: _AnyCamera = None,
    *,
    scores: ArrayLike | None = None,
    initial_pose: tuple[ArrayLike, ArrayLike] | None = None,
    known_direction: tuple[ArrayLike, ArrayLike, float] | None = None,
    invalid: _Invalid = "outlier",
    **options: Unpack[EstimateOptions],
) -> Estimate: ...
def estimate_batch(
    x1: ArrayLike,
    x2: ArrayLike,
    offsets: ArrayLike,
    cameras1: _AnyCamera | Sequence[_AnyCamera] = None,
    cameras2: _AnyCamera | Sequence[_AnyCamera] = None,
    *,
    first_index: int = 0,
    num_threads: int = 0,
    scores: ArrayLike | None = None,
    indices: ArrayLike | None = None,
    invalid: _Invalid = "outlier",
    progress: Callable[[int, int], object] | None = None,
    known_direction: tuple[ArrayLike, ArrayLike, float] | None = None,
    **options: Unpack[EstimateOptions],
) -> EstimateBatch: ...
def _estimate(state: tuple[Any, ...]) -> Estimate: ...
def _estimate_batch(state: tuple[Any, ...]) -> EstimateBatch: ...
def _runner_up(state: tuple[Any, ...]) -> RunnerUp: ...
def _third_view(
    x1: ArrayLike,
    x2: ArrayLike,
    x3: ArrayLike,
    cameras: Sequence[Camera | ArrayLike | None],
    options: Mapping[str, Any],
) -> tuple[Estimate, Estimate, tuple[float, float, float] | None]: ...
def constraint_matrix(x1: ArrayLike, x2: ArrayLike) -> _Array: ...
def _solve_batch(
    x1: ArrayLike, x2: ArrayLike
) -> tuple[NDArray[np.int64], _Array, _Array, NDArray[np.int64], _Array]: ...
def _candidate(state: tuple[Any, ...]) -> Candidate: ...
def _solvers() -> list[tuple[str, int, int, str, str]]: ...
def _choose(
    x1: ArrayLike,
    x2: ArrayLike,
    x3: ArrayLike,
    poses_21: Sequence[tuple[ArrayLike, ArrayLike]],
    poses_31: Sequence[tuple[ArrayLike, ArrayLike]],
    cameras: tuple[_AnyCamera, _AnyCamera, _AnyCamera],
    noise: float,
) -> tuple[int, int, float, float, float] | None: ...
def _solve_polynomials(
    unknowns: int,
    equations: Sequence[Sequence[tuple[float, Sequence[int]]]],
    solutions: int | None,
    max_rounds: int,
    max_monomials: int,
    seed: int,
) -> tuple[list[list[float]], list[list[float]], list[float], list[int], list[bool], int, dict[str, Any]]: ...
def _translation_and_depths(
    r: ArrayLike,
    x1: ArrayLike,
    x2: ArrayLike,
    camera1: _AnyCamera,
    camera2: _AnyCamera,
) -> tuple[list[float], list[float], list[float], float, int]: ...
def _rotation_metric(r: ArrayLike, r_est: ArrayLike) -> float: ...
def _translation_metric(t: ArrayLike, t_est: ArrayLike) -> float: ...
def _parallax(t: ArrayLike, depths1: ArrayLike, depths2: ArrayLike) -> float: ...
def _columns() -> tuple[list[str], list[float]]: ...
def _scene(
    points: int,
    layout: str,
    motion: str,
    parallax: float | None,
    max_angle: float | None,
    view: str,
    noise_px: float,
    rounded: bool,
    boxes: tuple[list[object], list[object]],
    seed: int,
    index: int,
) -> tuple[_Array, _Array, _Array, list[float], _Array]: ...

@final
class Command:
    @property
    def linear(self) -> _Array: ...
    @property
    def angular(self) -> _Array: ...
    @property
    def speed(self) -> float: ...
    @property
    def turn_rate(self) -> float: ...
    @property
    def state(
        self,
    ) -> Literal[
        "tracking",
        "rotation_only",
        "exploring",
        "confirming",
        "ambiguous",
        "coasting",
        "starting",
        "too_few_features",
        "degenerate",
        "inconsistent",
        "jump",
        "uncertain",
        "diverging",
        "stale",
    ]: ...
    @property
    def advice(self) -> str: ...
    @property
    def R(self) -> _Array | None: ...
    @property
    def t(self) -> _Array | None: ...
    @property
    def covariance(self) -> _Array | None: ...
    @property
    def residual(self) -> float | None: ...
    @property
    def inliers(self) -> int: ...
    @property
    def inlier_mask(self) -> _Bools: ...
    @property
    def seen(self) -> int: ...
    @property
    def hypotheses(self) -> int: ...
    @property
    def image(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def holding_images(self) -> int: ...
    @property
    def holding_seconds(self) -> float: ...
    @property
    def restarts(self) -> int: ...
    @property
    def arrived(self) -> bool: ...
    @property
    def border_limits(self) -> bool: ...
    def to_dict(self) -> dict[str, Any]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def _command(state: tuple[Any, ...]) -> Command: ...

@disjoint_base
class Controller:
    def step(self, points: ArrayLike, /, stamp: float | None = None, now: float | None = None) -> Command: ...
    def idle(self, now: float, /) -> tuple[_Array, _Array]: ...
    def reset(self) -> None: ...
    def depths(self) -> tuple[_Array, _Array]: ...
    def set_depths(self, depths: ArrayLike, /, precision: ArrayLike | None = None) -> None: ...
    @property
    def unit(self) -> float: ...
    @property
    def period(self) -> float: ...
    max_speed: float
    max_turn_rate: float
    max_acceleration: float
    max_turn_acceleration: float
    explore: float
    tolerance: float
    angle_tolerance: float
    arrival_time: float
    coasting_images: int
    largest_gap: float
    rotation_uncertainty: float
    translation_uncertainty: float
    watchdog: bool

@final
class CameraServo(Controller):
    def __new__(
        cls,
        goal: ArrayLike,
        camera: Camera | ArrayLike | None = None,
        *,
        max_speed: float,
        max_turn_rate: float,
        max_acceleration: float | None = None,
        max_turn_acceleration: float | None = None,
        noise: float,
        goal_images: int = 1,
        period: float = 0.1,
        unit: float | None = None,
        rate: float = 0.5,
        depths: ArrayLike | None = None,
        depth_precision: ArrayLike | None = None,
        explore: float = 0.0,
        tolerance: float = 0.01,
        angle_tolerance: float = 0.5,
        arrival_time: float = 0.5,
        coasting_images: int = 1,
        largest_gap: float = 0.5,
        axes: Sequence[str] | None = None,
        camera_in_hand: ArrayLike | None = None,
        solver: str | None = None,
    ) -> CameraServo: ...
    rate: float

@final
class RobotServo(Controller):
    def __new__(
        cls,
        goal: ArrayLike,
        camera: Camera | ArrayLike | None = None,
        *,
        max_speed: float,
        max_turn_rate: float,
        max_acceleration: float | None = None,
        max_turn_acceleration: float | None = None,
        noise: float,
        goal_images: int = 1,
        period: float = 0.1,
        unit: float | None = None,
        speed_gain: float = 0.5,
        turn_gain: float = 1.0,
        tilt: float = 0.01,
        border: float = 40.0,
        depths: ArrayLike | None = None,
        depth_precision: ArrayLike | None = None,
        explore: float = 0.0,
        tolerance: float = 0.01,
        angle_tolerance: float = 0.5,
        arrival_time: float = 0.5,
        coasting_images: int = 1,
        largest_gap: float = 0.5,
        camera_in_base: tuple[float, float, float] | ArrayLike | None = None,
        solver: str | None = None,
    ) -> RobotServo: ...
    speed_gain: float
    turn_gain: float
    stop_distance: float
    sideways_distance: float
    start_distance: float
    @property
    def has_arrived(self) -> bool: ...

def joint_velocities(
    linear: ArrayLike,
    angular: ArrayLike,
    jacobian: ArrayLike,
    /,
    *,
    max_speeds: ArrayLike,
    damping: float = 0.05,
    positions: ArrayLike | None = None,
    ends: ArrayLike | None = None,
    seconds: float = 0.5,
) -> tuple[_Array, float]: ...
def _colmap_verify(
    database: _Path,
    pairs: _Names | None,
    min_inliers: int,
    min_inlier_ratio: float,
    existing: str,
    uncalibrated: str,
    watermark: float,
    num_threads: int,
    dry_run: bool,
    progress: Callable[[int, int], object] | None,
    options: Mapping[str, Any],
) -> str: ...
def _colmap_read_pairs(path: _Path) -> _Names: ...
def _colmap_write(
    database: _Path, pairs: _Names, estimates: Sequence[Estimate | None], overwrite: bool
) -> None: ...
def _colmap_export(
    database: _Path,
    target: _Path,
    what: str,
    pairs: _Names | None,
    min_inliers: int,
    progress: Callable[[int, int], object] | None,
    options: Mapping[str, Any],
) -> tuple[int, _Names]: ...
