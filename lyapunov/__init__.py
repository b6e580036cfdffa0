"""Lyapunov and Floquet exponents of hybrid systems, covariant vectors, dimension, a test for chaos."""

from lyapunov import plot as plot
from lyapunov.chart import chart
from lyapunov.compare import ModelComparison, compare_models
from lyapunov.covariant import CovariantVectors, covariant_vectors
from lyapunov.dimension import kaplan_yorke_dimension
from lyapunov.finite_time import finite_time_exponents
from lyapunov.floquet import floquet_exponents
from lyapunov.spectrum import LyapunovSpectrum, lyapunov_spectrum
from lyapunov.two_orbit import TwoOrbitExponents, two_orbit_exponents
from lyapunov.zero_one import ZeroOneTest, zero_one_test

__all__ = [
    "CovariantVectors",
    "LyapunovSpectrum",
    "ModelComparison",
    "TwoOrbitExponents",
    "ZeroOneTest",
    "chart",
    "compare_models",
    "covariant_vectors",
    "finite_time_exponents",
    "floquet_exponents",
    "kaplan_yorke_dimension",
    "lyapunov_spectrum",
    "two_orbit_exponents",
    "zero_one_test",
]
