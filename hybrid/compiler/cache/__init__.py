"""The cache on disk, shared between processes: compiled kernels and the results of analysing models."""
