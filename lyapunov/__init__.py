"""Lyapunov and Floquet exponents of hybrid systems."""

from lyapunov.spectrum import LyapunovSpectrum, lyapunov_spectrum

__all__ = ["LyapunovSpectrum", "lyapunov_spectrum"]
