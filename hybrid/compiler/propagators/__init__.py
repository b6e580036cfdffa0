"""How a mode is advanced: one file per propagator, in the order of ``choice.STRATEGIES``."""
