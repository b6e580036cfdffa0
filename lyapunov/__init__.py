"""Lyapunov and Floquet exponents of hybrid systems."""

from lyapunov import plot as plot
from lyapunov.chart import chart
from lyapunov.compare import ModelComparison, compare_models
from lyapunov.floquet import floquet_exponents
from lyapunov.spectrum import LyapunovSpectrum, lyapunov_spectrum
from lyapunov.two_orbit import TwoOrbitExponents, two_orbit_exponents

__all__ = [
    "LyapunovSpectrum",
    "ModelComparison",
    "TwoOrbitExponents",
    "chart",
    "compare_models",
    "floquet_exponents",
    "lyapunov_spectrum",
    "two_orbit_exponents",
]
