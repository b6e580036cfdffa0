"""What is kept on disk between processes: compiled kernels, and what was found out about models."""
