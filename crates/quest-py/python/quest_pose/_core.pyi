from collections.abc import Sequence
from typing import Any, ClassVar, Literal, TypeAlias, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "BadCamera",
    "Camera",
    "CameraServo",
    "Candidate",
    "Command",
    "DegenerateInput",
    "Estimate",
    "EstimateBatch",
    "NoPose",
    "NotFinite",
    "QuestError",
    "RobotServo",
    "RunnerUp",
    "ShapeMismatch",
    "TooFewMatches",
    "__version__",
    "_candidate",
    "_estimate",
    "_estimate_batch",
    "_runner_up",
    "_solve_batch",
    "_solvers",
    "_third_view",
    "constraint_matrix",
    "estimate",
    "estimate_batch",
    "solve",
]

__version__: str

_Array: TypeAlias = NDArray[np.float64]
_Bools: TypeAlias = NDArray[np.bool_]
_Counts: TypeAlias = NDArray[np.uint64]
_Kind: TypeAlias = Literal["exact", "from_complex", "rotation_only", "planar"]
_Model: TypeAlias = Literal["general", "planar", "pure_rotation"]

class QuestError(ValueError): ...
class TooFewMatches(QuestError): ...
class NotFinite(QuestError): ...
class ShapeMismatch(QuestError): ...
class DegenerateInput(QuestError): ...
class BadCamera(QuestError): ...
class NoPose(QuestError): ...

@final
class Camera:
    def __new__(
        cls, model: str, params: ArrayLike, *, width: int | None = None, height: int | None = None
    ) -> Camera: ...
    @staticmethod
    def from_k(k: ArrayLike, /) -> Camera: ...
    @property
    def model(self) -> str: ...
    @property
    def params(self) -> tuple[float, ...]: ...
    @property
    def width(self) -> int | None: ...
    @property
    def height(self) -> int | None: ...
    def bearing(self, pixels: ArrayLike, /) -> _Array: ...
    def project(self, points: ArrayLike, /) -> _Array: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __getnewargs_ex__(self) -> tuple[tuple[str, Sequence[float]], dict[str, int | None]]: ...

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
class Candidate:
    @property
    def kind(self) -> _Kind: ...
    @property
    def R(self) -> _Array: ...
    @property
    def t(self) -> _Array: ...
    @property
    def quat_wxyz(self) -> _Array: ...
    @property
    def quat_xyzw(self) -> _Array: ...
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
    camera1: Camera | ArrayLike | None = None,
    camera2: Camera | ArrayLike | None = None,
    *,
    solver: str | None = None,
    kinds: Literal["all", "exact", "planar"] = "all",
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
    covariance: list[list[float]]
    inliers: list[bool]
    iterations: int
    runner_up: _RunnerUpDict | None
    evidence: dict[str, float | None]
    noise_px: float

@final
class RunnerUp:
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
    def score(self) -> float: ...
    @property
    def inlier_count(self) -> int: ...
    def to_dict(self) -> _RunnerUpDict: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Estimate:
    @property
    def model(self) -> _Model: ...
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
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> tuple[Any, ...]: ...

def estimate(
    x1: ArrayLike,
    x2: ArrayLike,
    camera1: Camera | ArrayLike | None = None,
    camera2: Camera | ArrayLike | None = None,
    *,
    threshold: float | None = None,
    confidence: float = 0.9999,
    min_iterations: int = 300,
    max_iterations: int = 100_000,
    max_false_alarms: float = 0.03,
    seed: int = 0,
    index: int = 0,
    solver: str | None = None,
    loss: Literal["marginalised", "truncated"] = "marginalised",
    scores: ArrayLike | None = None,
    initial_pose: tuple[ArrayLike, ArrayLike] | None = None,
    known_direction: tuple[ArrayLike, ArrayLike, float] | None = None,
) -> Estimate: ...
def estimate_batch(
    x1: ArrayLike,
    x2: ArrayLike,
    offsets: ArrayLike,
    cameras1: Camera | ArrayLike | Sequence[Camera | ArrayLike] | None = None,
    cameras2: Camera | ArrayLike | Sequence[Camera | ArrayLike] | None = None,
    *,
    threshold: float | None = None,
    confidence: float = 0.9999,
    min_iterations: int = 300,
    max_iterations: int = 100_000,
    max_false_alarms: float = 0.03,
    seed: int = 0,
    first_index: int = 0,
    solver: str | None = None,
    loss: Literal["marginalised", "truncated"] = "marginalised",
    num_threads: int = 0,
) -> EstimateBatch: ...
def _estimate(state: tuple[Any, ...]) -> Estimate: ...
def _estimate_batch(state: tuple[Any, ...]) -> EstimateBatch: ...
def _runner_up(state: tuple[Any, ...]) -> RunnerUp: ...
def _third_view(
    x1: ArrayLike,
    x2: ArrayLike,
    x3: ArrayLike,
    cameras: Sequence[Camera | ArrayLike | None],
    threshold: float | None,
    confidence: float,
    max_iterations: int,
    seed: int,
) -> tuple[Estimate, Estimate, tuple[float, float, float] | None]: ...
def constraint_matrix(x1: ArrayLike, x2: ArrayLike) -> _Array: ...
def _solve_batch(
    x1: ArrayLike, x2: ArrayLike
) -> tuple[NDArray[np.int64], _Array, _Array, NDArray[np.int64], _Array]: ...
def _candidate(state: tuple[Any, ...]) -> Candidate: ...
def _solvers() -> list[tuple[str, int, int, str]]: ...

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
        "tracking", "starting", "too_few_features", "degenerate", "inconsistent", "jump", "uncertain"
    ]: ...
    @property
    def R(self) -> _Array | None: ...
    @property
    def t(self) -> _Array | None: ...
    @property
    def inliers(self) -> int: ...

@final
class CameraServo:
    def __new__(
        cls,
        goal: ArrayLike,
        camera: Camera | ArrayLike | None = None,
        *,
        max_speed: float,
        max_turn_rate: float,
        noise: float,
        goal_images: int = 1,
        period: float = 0.1,
        unit: float = 1.0,
        rate: float = 0.5,
        depths: ArrayLike | None = None,
        solver: str | None = None,
    ) -> CameraServo: ...
    def step(self, points: ArrayLike, /) -> Command: ...

@final
class RobotServo:
    def __new__(
        cls,
        goal: ArrayLike,
        camera: Camera | ArrayLike | None = None,
        *,
        max_speed: float,
        max_turn_rate: float,
        noise: float,
        goal_images: int = 1,
        period: float = 0.1,
        unit: float = 1.0,
        speed_gain: float = 0.5,
        turn_gain: float = 1.0,
        tilt: float = 0.01,
        border: float = 40.0,
        depths: ArrayLike | None = None,
        solver: str | None = None,
    ) -> RobotServo: ...
    def step(self, points: ArrayLike, /) -> Command: ...
    @property
    def has_arrived(self) -> bool: ...
