"""Steps of several runs at once: each number of a kernel here is a register with one number of each run."""
