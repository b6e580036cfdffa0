"""Codes, rows of the scratch memory and places of the counters of the paper's method."""

DONE, STEP_TOO_SMALL, RECORD_FULL = 0, 1, 2
# Rows of the scratch memory.
F0, F1, F2, K1, K2, K3, NEW, DFDT, PROBE, FAR, THRESHOLDS, INCREMENTS, SCRATCH_ROWS = range(13)
# Places of the counters.
ACCEPTED, REJECTED, EVALUATIONS, COUNTERS = range(4)
