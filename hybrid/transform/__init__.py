"""Systems made from systems."""
