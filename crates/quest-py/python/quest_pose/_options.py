"""The options of ``estimate``: their names, types, meanings and defaults, for every function that takes them."""

from typing import Literal, TypedDict


class EstimateOptions(TypedDict, total=False):
    """The options of ``estimate``, ``estimate_batch``, ``third_view``, ``colmap.verify`` and ``arrow.estimate``: keywords.

    An option that is absent, or None, has its default.

    Attributes
    ----------
    threshold : float
        Matches with a Sampson error below this are inliers: two to three standard deviations of the points' noise, in
        pixels, 1 by default. Without cameras it is in units of the plane z = 1, in radians for bearings, and must be given.
    confidence : float
        How sure to be that a sample without outliers was seen before the search stops: 0.9999 by default.
    min_iterations : int
        At least this many samples are drawn: 100 by default.
    max_iterations : int
        At most this many samples are drawn: 100,000 by default.
    max_false_alarms : float
        The best pose is returned if at most this many poses as good as it are expected where all matches are false: 0.03 by
        default. A smaller number refuses more poses of chance; infinity returns the best pose whatever chance explains.
    seed : int
        The same seed gives the same answer, bit for bit: 0 by default.
    index : int
        Which of the pairs that share a seed this is: each has random numbers of its own. 0 by default. ``estimate_batch``
        takes ``first_index`` or ``indices`` in its place; ``third_view`` and ``colmap.verify`` number their pairs themselves.
    solver : str
        The solver of the samples, one of the names in ``solvers()``: the first of them by default.
    loss : {"marginalised", "truncated"}
        How the search scores a residual: averaged over all thresholds up to one, which is the default, or with one threshold
        (MSAC).
    """

    threshold: float | None
    confidence: float
    min_iterations: int
    max_iterations: int
    max_false_alarms: float
    seed: int
    index: int
    solver: str | None
    loss: Literal["marginalised", "truncated"]
