"""Equilibria of a mode, by Newton's method."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.display.tables import html_table, with_unit
from hybrid.errors import ArgumentError
from hybrid.orbits.equilibria.equations import Equations, reduced, sizes_of
from hybrid.orbits.equilibria.smooth import row_lengths
from hybrid.simulation.labelled import Names, attributes, with_outputs
from hybrid.simulation.quantities import Asked, table_of
from hybrid.simulation.trajectory import explore
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.system.graph import HybridSystem, as_system, check_mode
from hybrid.system.growth import growing

if TYPE_CHECKING:
    import xarray

EPSILON = float(np.finfo(float).eps)
# Newton's steps are shortened down to this share.
SHORTEST = 2.0**-20
# They end at this size, in units of the state, and have failed if they stay above the second one.
SMALL, LOOSE = 4 * EPSILON, 1e-9
MOST_STEPS = 60
# Singular values below this share of the largest count as zero.
SINGULAR = 1e-13
# A component below this, in units of the state, is zero.
ZERO = 16 * EPSILON
# Rounding of an eigenvalue, in units of the largest entry of the matrix.
ROUNDING = 100 * EPSILON


@attrs.frozen(eq=False, repr=False)
class Equilibrium(Asked):
    """A state at which the field of a mode is zero, or the best point that Newton's method reached.

    ``equilibrium["q"]`` is a component of the state, or an output there, ``(1,)``.

    Attributes
    ----------
    system, parameters
        The model, and the values of all its parameters, by name.
    x, mode
        The state ``(n,)``, and the mode.
    eigenvalues
        Of the derivative of the field, the one with the largest real part first. Of a mode that stays on a
        surface, as a sliding mode does (a pseudo-equilibrium), those within the surface. Held components
        and counters have none.
    stable
        Whether no eigenvalue has a positive real part.
    admissible
        Whether a run may stay there: not if the state lies beyond a guard of the mode (a virtual
        equilibrium), or a clock takes the run out of the mode.
    excluded_by
        The names of those transitions.
    residual
        The largest rate of a component, in units of the component per time.
    iterations
        Newton steps used.
    status
        Whether Newton's method converged.

    Examples
    --------
    >>> import hybrid
    >>> rattler = hybrid.HybridSystem(
    ...     state=("q", "v"),
    ...     parameters={"k": 9.0},
    ...     modes=[
    ...         hybrid.Mode("free", lambda t, x, p: (x.v, 1.0 - 0.2 * x.v)),
    ...         hybrid.Mode("stop", lambda t, x, p: (x.v, 1.0 - 0.2 * x.v - p.k * x.q)),
    ...     ],
    ...     transitions=[
    ...         hybrid.Transition("free", "stop", hybrid.Guard(lambda t, x, p: x.q, +1)),
    ...         hybrid.Transition("stop", "free", hybrid.Guard(lambda t, x, p: x.q, -1)),
    ...     ],
    ... )
    >>> rest = hybrid.equilibrium(rattler, (0.2, 0.0))
    >>> rest.mode, rest.x.round(6).tolist(), rest.stable, rest.admissible
    ('stop', [0.111111, 0.0], True, True)
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    x: np.ndarray
    mode: str
    eigenvalues: np.ndarray
    stable: bool
    admissible: bool
    excluded_by: tuple[str, ...]
    residual: float
    iterations: int
    status: Status

    def _table(self, names: Iterable[str]) -> np.ndarray:
        """Components and outputs at the state, ``(1, len(names))``."""
        values = self.system.parameter_values(self.parameters)
        mode = np.array([self.system.mode_index(self.mode)])
        return table_of(self.system, [*names], np.zeros(1), self.x[None], mode, values)

    def __repr__(self) -> str:
        if not self.status.ok:
            return f"<Equilibrium NOT CONVERGED, residual {self.residual:.1e} in {self.mode!r}>"
        names = self.system.state_names
        at = ", ".join(f"{name} = {value:.6g}" for name, value in zip(names, self.x, strict=True))
        words = ["stable" if self.stable else "unstable", "admissible" if self.admissible else "virtual"]
        return f"<Equilibrium {at} in {self.mode!r}, {', '.join(words)}>"

    def _repr_html_(self) -> str:
        """The equilibrium for a notebook."""
        units = self.system.units
        rows = [
            [with_unit(name, units.get(name)), f"{value:.9g}"]
            for name, value in zip(self.system.state_names, self.x, strict=True)
        ]
        own = [
            [f"{value.real:.6g}" + (f" {value.imag:+.6g}i" if value.imag else "")]
            for value in self.eigenvalues
        ]
        tables = f"{html_table(('component', 'value'), rows)}\n{html_table(('eigenvalue',), own)}"
        return f"<p>{escape(repr(self))}</p>\n{tables}"

    def to_xarray(self) -> xarray.Dataset:
        """The numbers of the equilibrium. Eigenvalues are complex: ``.to_zarr`` saves them, netCDF cannot."""
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables: dict[str, Any] = {
            "x": ("state", self.x, names.states),
            "mode": self.mode,
            "eigenvalues": ("eigenvalue", self.eigenvalues),
            "stable": self.stable,
            "admissible": self.admissible,
            "residual": self.residual,
        }
        made_by = attributes("equilibrium", self.status, self.system, self.parameters)
        found = xarray.Dataset(variables, names.coords(), made_by)
        [row] = self._table(self.system.outputs)
        return with_outputs(found, self.system, {"outputs": ((), row)})


@growing
def equilibrium(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    max_iterations: int = MOST_STEPS,
) -> Equilibrium:
    """Equilibrium near a guess, stable or not, by Newton's method with exact derivatives.

    A mode that stays on a surface, such as a sliding mode, has its equilibria there: pseudo-equilibria. What
    is searched for may lie where another mode holds (a virtual equilibrium); it says so.

    Parameters
    ----------
    system, parameters
        As for :func:`hybrid.simulate`.
    x0
        Guess of the state ``(n,)``. Held components and counters keep their values.
    mode
        The mode whose equilibrium is wanted. By default each is tried, those that allow the guess first, and
        the first equilibrium that is admissible is taken; without one, the first that there is.
    max_iterations
        Largest number of Newton steps in a mode.

    Returns
    -------
    Equilibrium
        With the status ``NOT_CONVERGED`` where Newton's method found none.

    Raises
    ------
    ArgumentError
        If a field reads the time, or cannot be traced; of several modes, if every one does.

    References
    ----------
    P. Deuflhard, Newton Methods for Nonlinear Problems, Springer 2011, section 3.3: the natural monotonicity
    test that shortens the steps.
    M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, Piecewise-smooth Dynamical Systems, Springer 2008,
    definitions 5.1 and 5.2: admissible, virtual, boundary and pseudo-equilibria.

    Examples
    --------
    >>> import models, hybrid
    >>> rest = hybrid.equilibrium(models.chua_circuit(), (1.5, 0.0, -1.5))
    >>> rest.status.ok, rest.stable
    (True, False)
    """
    as_system("system", system)
    state = system.variables.state_values("x0", x0)
    vector = system.parameter_values(parameters)
    most = arguments.count("max_iterations", max_iterations, 0)
    mode = explore(system, 0.0, state, vector, mode)
    if mode is not None:
        check_mode(system, mode)
        parts = [system.mode_names[i] for i in system.parts_of(mode)]
        if len(parts) == 1:
            return solved(Equations(system, parts[0], (), state, vector), most)
    else:
        parts = [*system.mode_names]
    return _first(system, parts, state, vector, most)


def _first(
    system: HybridSystem, modes: list[str], state: np.ndarray, vector: np.ndarray, most: int
) -> Equilibrium:
    """The first admissible equilibrium of several modes, else the first one, else the first best point."""
    known: list[Equations] = []
    refused: ArgumentError | None = None
    for name in modes:
        try:
            known.append(Equations(system, name, (), state, vector))
        except ArgumentError as why:
            refused = why
    if refused is not None and not known:
        raise refused
    known.sort(key=lambda each: bool(each.excluded_by(each.start())))
    found = []
    for each in known:
        found.append(solved(each, most))
        if found[-1].status.ok and found[-1].admissible:
            return found[-1]
    return min(found, key=lambda each: not each.status.ok)


def solved(equations: Equations, most: int = MOST_STEPS) -> Equilibrium:
    """Newton's method in a mode, from its own start."""
    u, before, count = equations.start(), np.inf, 0
    step = _newton(equations, u)
    units = _units(equations, u, step)
    size = _size(step, units)
    while count < most and np.isfinite(size) and size > SMALL and not (size <= LOOSE and size >= before / 2):
        count += 1
        share, before = 1.0, size
        # The step of the same matrix there tells whether it is nearer.
        while size > LOOSE and not (
            _size(_newton(equations, u + share * step, at=u), units) <= (1.0 - share / 4.0) * size
        ):
            share /= 2.0
            if share < SHORTEST:
                return described(equations, u, count, ok=False)
        u = u + share * step
        step = _newton(equations, u)
        units = np.maximum(units, _units(equations, u, step))
        size = _size(step, units)
    ok = bool(size <= LOOSE)
    return described(equations, _rounded(equations, u, units) if ok else u, count, ok=ok)


def _units(equations: Equations, u: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Units of the state: its own size, and that of a step."""
    return sizes_of(equations.matrix(u), np.maximum(np.abs(u), np.abs(step)))


def _rounded(equations: Equations, u: np.ndarray, units: np.ndarray) -> np.ndarray:
    """The solution with zeros in place of what is zero up to rounding, if they are as good."""
    there = np.where(np.abs(u) <= ZERO * units, 0.0, u)
    sizes = [_size(_newton(equations, each), units) for each in (u, there)]
    return there if sizes[1] <= max(sizes[0], SMALL) else u


def _newton(equations: Equations, u: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
    """Newton's step from a state, the shortest one; with the derivatives ``at`` another state if given."""
    part = reduced(equations, u if at is None else at)
    rows, values = part.jacobian(u if at is None else at), part.residual(u)
    if not (np.isfinite(rows).all() and np.isfinite(values).all()):
        return np.full(len(u), np.inf)
    lengths = row_lengths(rows)
    scaled, wanted = rows / lengths[:, None], -values / lengths
    if np.linalg.matrix_rank(scaled, tol=SINGULAR) == len(u):
        # Elimination leaves components that have nothing to do with each other alone: a zero stays one.
        return np.linalg.solve(scaled, wanted)
    return np.linalg.lstsq(scaled, wanted, rcond=SINGULAR)[0]


def _size(step: np.ndarray, units: np.ndarray) -> float:
    return float(np.abs(step / units).max(initial=0.0))


def described(equations: Equations, u: np.ndarray, count: int = 0, *, ok: bool = True) -> Equilibrium:
    """A point as a result."""
    own = eigenvalues_of(equations.within(u))
    rates = equations.rates.value(equations.known(u))
    excluded = equations.excluded_by(u)
    status = SUCCESS
    if not ok:
        status = Status(
            StatusCode.NOT_CONVERGED,
            f"Newton's method found no equilibrium of mode {equations.mode!r} after {count} steps.",
            "Start nearer to one, or in another mode; where a run comes to rest is a good guess.",
        )
    return Equilibrium(
        system=equations.system,
        parameters=equations.parameters(u),
        x=equations.state(u),
        mode=equations.mode,
        eigenvalues=own,
        stable=ok and is_stable(own),
        admissible=ok and not excluded,
        excluded_by=excluded,
        residual=float(np.abs(rates).max(initial=0.0)),
        iterations=count,
        status=status,
    )


def eigenvalues_of(matrix: np.ndarray) -> np.ndarray:
    """Eigenvalues, the one with the largest real part first."""
    if not np.isfinite(matrix).all():
        return np.full(len(matrix), np.nan + 0j)
    found = np.linalg.eigvals(matrix).astype(complex)
    return found[np.lexsort((-found.imag, -found.real))]


def is_stable(eigenvalues: np.ndarray) -> bool:
    """Whether no real part is positive, up to rounding."""
    largest = float(np.abs(eigenvalues).max(initial=0.0))
    return bool(np.all(eigenvalues.real <= ROUNDING * largest))
