"""Filippov systems in the plane."""

from hybrid.transform.filippov import filippov

PLANE = ("x", "y")


def height(t, x, p):
    return x.y


def planar(below, above, switching=height, parameters=None, **options):
    return filippov(PLANE, parameters or {}, below, above, switching, **options)


def events(arc):
    return [jump.transition for jump in arc.jumps]
