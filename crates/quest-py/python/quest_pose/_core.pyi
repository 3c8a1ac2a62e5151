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
    "NotFinite",
    "QuestError",
    "RobotServo",
    "ShapeMismatch",
    "TooFewMatches",
    "__version__",
    "_candidate",
    "_solvers",
    "constraint_matrix",
    "solve",
]

__version__: str

_Array: TypeAlias = NDArray[np.float64]
_Kind: TypeAlias = Literal["exact", "from_complex", "rotation_only"]

class QuestError(ValueError): ...
class TooFewMatches(QuestError): ...
class NotFinite(QuestError): ...
class ShapeMismatch(QuestError): ...
class DegenerateInput(QuestError): ...
class BadCamera(QuestError): ...

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
    kinds: Literal["all", "exact"] = "all",
) -> list[Candidate]: ...
def constraint_matrix(x1: ArrayLike, x2: ArrayLike) -> _Array: ...
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
