"""Interval programs: data with which the kernels bound guards, forcings and rounding over a step."""
