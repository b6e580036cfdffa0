"""Text output: progress bars and tables."""
