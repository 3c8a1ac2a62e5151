"""Every solution of a system of polynomial equations."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from quest_pose._core import QuestError, _solve_polynomials

_Exponents: TypeAlias = Sequence[int]
# The keys are tuples of exponents; a mapping from pairs is none from tuples of any length to a type checker.
Polynomial: TypeAlias = Mapping[Any, float] | Iterable[tuple[float, _Exponents]]


class PolynomialSolutions(NamedTuple):
    """The solutions of a system, those that run together once: the real ones first."""

    x: NDArray[np.complex128]
    """(S, n): the unknowns. In a homogeneous system of norm 1, with the largest one real and positive."""
    is_real: NDArray[np.bool_]
    """(S,): whether all unknowns are real, to rounding."""
    residual: NDArray[np.float64]
    """(S,): the largest absolute value of an equation, relative to the sum of the absolute values of its terms."""
    multiplicity: NDArray[np.int64]
    """(S,): how many solutions run together; 1 for a simple one."""
    at_infinity: int
    """How many solutions lie at infinity and are left out, counted with multiplicity."""
    report: dict[str, Any]
    """The sizes, ranks and nullities of the matrices of section 4.2, with the singular values on either side of each rank."""

    @property
    def real(self) -> NDArray[np.float64]:
        """The real solutions, one a row."""
        return self.x[self.is_real].real


def solve_polynomials(
    equations: Iterable[Polynomial],
    *,
    solutions: int | None = None,
    max_rounds: int = 8,
    max_monomials: int = 1_000,
    seed: int = 42,
) -> PolynomialSolutions:
    """Every solution of a system of polynomial equations ``f(x) = 0``, real and complex.

    By relinearisation, section 4.2 of the paper, with as many rounds as it takes: any number of unknowns, any degrees,
    homogeneous or not, with at least as many equations as unknowns.

    Parameters
    ----------
    equations : iterable
        Polynomials: mappings from the exponents of the unknowns to coefficients, ``{(2, 0): 1, (0, 2): 1, (0, 0): -4}``
        for ``x**2 + y**2 - 4``, or lists of ``(coefficient, exponents)``.
    solutions : int, optional
        How many solutions there are, those at infinity counted: for coefficients with noise, which leave an overdetermined
        system without solutions. Where it is absent the number follows from the ranks.
    max_rounds : int
        How many rounds of relinearisation there may be.
    max_monomials : int
        How many monomials a round may have: time grows with the third power, one second for 700.
    seed : int
        The seed of the random combinations of commuting matrices.

    Returns
    -------
    PolynomialSolutions
        Named fields. Equations that contradict each other have no solutions: the arrays are empty.

    Raises
    ------
    NoAnswer
        Where the list would not be complete: fewer equations than unknowns, solutions that are no isolated points, or more
        of them than the rounds tell apart. It is never a part of the solutions.
    QuestError
        For equations that are none: no terms, other numbers of exponents, a coefficient that is not finite.

    Notes
    -----
    Where the degrees of all terms share a divisor, ``report["grading"]``, a solution times a root of one of that order is a
    solution too. They count as one: with even degrees ``x`` and ``-x``.

    Examples
    --------
    A circle and a hyperbola, which meet in two points and their negatives:

    >>> import quest_pose as qp
    >>> circle = {(2, 0): 1, (0, 2): 1, (0, 0): -4}
    >>> hyperbola = {(1, 1): 1, (0, 0): -1}
    >>> found = qp.solve_polynomials([circle, hyperbola])
    >>> len(found.real), found.at_infinity, found.report["grading"]
    (2, 0, 2)
    """
    rows = [_terms(number, equation) for number, equation in enumerate(equations)]
    unknowns = next((len(exponents) for row in rows for _, exponents in row), 0)
    re, im, residual, multiplicity, is_real, at_infinity, report = _solve_polynomials(
        unknowns, rows, solutions, max_rounds, max_monomials, seed
    )
    shape = (len(re), unknowns)
    return PolynomialSolutions(
        np.array(re, np.float64).reshape(shape) + 1j * np.array(im, np.float64).reshape(shape),
        np.array(is_real, np.bool_),
        np.array(residual, np.float64),
        np.array(multiplicity, np.int64),
        at_infinity,
        report,
    )


def _terms(number: int, equation: Polynomial) -> list[tuple[float, list[int]]]:
    """The terms of an equation as coefficients and exponents."""
    given: Iterable[Any] = equation
    if isinstance(equation, Mapping):
        given = [(c, e) for e, c in equation.items()]
    terms = []
    for term in given:
        try:
            coefficient, exponents = term
            row = (float(coefficient), [int(e) for e in exponents])
        except (TypeError, ValueError) as error:
            expected = "a coefficient and the exponents of the unknowns"
            raise QuestError(f"equation {number} has the term {term!r}, expected {expected}") from error
        if any(e < 0 or e > 255 or e != given_e for e, given_e in zip(row[1], exponents, strict=True)):
            expected = "whole exponents from 0 to 255"
            raise QuestError(f"equation {number} has the exponents {list(exponents)}, expected {expected}")
        terms.append(row)
    return terms
