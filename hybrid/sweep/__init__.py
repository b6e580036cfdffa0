"""A task at every point of a grid: labelled results, in threads or on a cluster, stored as they are made."""
