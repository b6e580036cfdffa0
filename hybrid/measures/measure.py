"""Measures of an arc: functions that make one number of the course of a component or an output."""

from __future__ import annotations

from collections.abc import Callable

import attrs

from hybrid import arguments
from hybrid.measures.profile import Profile, profile_of
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.quantities import quantity
from hybrid.system.graph import HybridSystem, as_system

FORMULAS: dict[str, Callable[[Profile], float]] = {
    "maximum": Profile.maximum,
    "minimum": Profile.minimum,
    "amplitude": Profile.amplitude,
    "mean": Profile.mean,
    "rms": Profile.rms,
}


@attrs.frozen(repr=False)
class Measure:
    """A function of an arc that makes one number of a component or an output along it.

    Make one with :func:`maximum`, :func:`minimum`, :func:`amplitude`, :func:`mean` or :func:`rms`.

    Attributes
    ----------
    kind
        Name of the function that made it.
    name
        Name of the component or the output.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import maximum
    >>> height = maximum("q")
    >>> height
    maximum('q')
    >>> round(height(hybrid.simulate(models.bouncing_ball(), (0.0, 2.0), (0.0, 1.0))), 12)
    0.203873598369
    """

    kind: str = attrs.field()
    name: str = attrs.field()

    @kind.validator
    def _check_kind(self, _: object, value: object) -> None:
        arguments.one_of("kind", value, (*FORMULAS,))

    @name.validator
    def _check_name(self, _: object, value: object) -> None:
        if not isinstance(value, str):
            raise arguments.refusal("name", "be the name of a component or an output", value)

    def __call__(self, arc: HybridArc) -> float:
        """The number.

        Raises
        ------
        ArgumentError
            If the arc has no such name or no dense output, or if a value is not finite.
        """
        arguments.instance("arc", arc, HybridArc, "Make one with simulate, or with orbit.arc().")
        return float(FORMULAS[self.kind](profile_of(arc, quantity("name: ", self.name, arc.system))))

    def unit(self, system: HybridSystem) -> str | None:
        """The unit of the number, if the system gives one for the name.

        Raises
        ------
        ArgumentError
            If there is no system.
        """
        return as_system("system", system).units.get(self.name)

    def __repr__(self) -> str:
        return f"{self.kind}({self.name!r})"


def maximum(name: str) -> Measure:
    """The largest value of a component or an output over an arc.

    It is found from the dense output, not from samples: on each step an extremum is a zero of the rate. At a
    jump both sides count. An output that has a value in some modes alone is looked at in these.

    Parameters
    ----------
    name
        Of a component of the state, or of an output of the system.

    Returns
    -------
    Measure
        A function of an arc, in the unit of the component.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import maximum
    >>> arc = hybrid.simulate(models.bouncing_ball(), (0.0, 2.0), (0.0, 1.0))
    >>> round(maximum("q")(arc) * 2 * 9.81, 12)
    4.0
    """
    return Measure("maximum", name)


def minimum(name: str) -> Measure:
    """The smallest value of a component or an output over an arc; as :func:`maximum`.

    Parameters
    ----------
    name
        Of a component of the state, or of an output of the system.

    Returns
    -------
    Measure
        A function of an arc, in the unit of the component.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import minimum
    >>> arc = hybrid.simulate(models.bouncing_ball(), (0.0, 2.0), (0.0, 0.5))
    >>> round(minimum("v")(arc), 12)
    -2.0
    """
    return Measure("minimum", name)


def amplitude(name: str) -> Measure:
    """Half of the way from the smallest to the largest value over an arc; as :func:`maximum`.

    Parameters
    ----------
    name
        Of a component of the state, or of an output of the system.

    Returns
    -------
    Measure
        A function of an arc, in the unit of the component.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import amplitude
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.1, 0.1), parameters={"A": 0.5, "w": 2.0})
    >>> round(amplitude("x")(orbit.arc()) - 0.5 / abs(1 - 2.0**2 + 0.2j), 9) == 0.0
    True
    """
    return Measure("amplitude", name)


def mean(name: str) -> Measure:
    """The time average of a component or an output over an arc, an integral of the dense output.

    Parameters
    ----------
    name
        Of a component of the state, or of an output that has a value in all modes of the arc.

    Returns
    -------
    Measure
        A function of an arc, in the unit of the component.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import mean
    >>> arc = hybrid.simulate(models.bouncing_ball(), (0.0, 2.0), (0.0, 2 * 2.0 / 9.81))
    >>> round(mean("q")(arc), 9) == round(2.0**2 / (3 * 9.81), 9)
    True
    """
    return Measure("mean", name)


def rms(name: str) -> Measure:
    """The root mean square of a component or an output over an arc, an integral of the dense output.

    Parameters
    ----------
    name
        Of a component of the state, or of an output that has a value in all modes of the arc.

    Returns
    -------
    Measure
        A function of an arc, in the unit of the component.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import rms
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.1, 0.1), parameters={"A": 0.5, "w": 2.0})
    >>> round(rms("x")(orbit.arc()) - 0.5 / abs(1 - 2.0**2 + 0.2j) / 2**0.5, 9) == 0.0
    True
    """
    return Measure("rms", name)
