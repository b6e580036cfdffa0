"""What kernels share: structures in memory, their fields, codes, and how kernels are compiled."""
