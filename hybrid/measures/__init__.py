"""What an orbit, or any arc, comes to in one number: its largest value, its mean, its amplitude.

Each measure is made with the name of a component or of an output, and is a function of an arc:
``maximum("x")(arc)``. :func:`hybrid.continue_orbit` takes measures, and any other function of an arc, as
``outputs=``; :func:`hybrid.attractors` takes them as ``features=``.
"""

from hybrid.measures.measure import Measure, amplitude, maximum, mean, minimum, rms

__all__ = ["Measure", "amplitude", "maximum", "mean", "minimum", "rms"]
