"""Guards along a step: their crossings and touches, isolated on pieces of the path."""
