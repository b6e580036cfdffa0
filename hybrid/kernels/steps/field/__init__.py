"""Whether the field along a step is what the step took it for.

A step is a polynomial ``p``: a series, or the interpolant of a Runge-Kutta method. Its residual
``p'(s) - f(t + s, p(s))`` has to be small.

- At a few places, evaluation tells (``residual``). Error estimates do not: they vanish by chance if a kink or
  jump lies at certain places of a step.
- Between the places at which the method looked, the parts of the field that could hide a pulse are bounded by
  intervals: they have to stay within what their values at these places explain (``pulses``, ``explained``).
- A short step keeps the residual of a jump below the tolerances. The state does not feel it, but its
  tangent vectors do, so the ends of a step are compared (``jumps``).
- The rounding of a late time moves the field as a residual does (``late``).
"""
