"""Speed and accuracy, measured: one file a question, ``python -m benchmarks.<name>``."""
