"""Mechanical systems with contacts whose motion has a closed form."""

import numpy as np

from hybrid import Contact, mechanics

G = 9.81


def ball(restitution="e", **given):
    """A ball of mass 1 that falls onto a floor."""
    return mechanics(
        coordinates=("y",),
        velocities=("v",),
        parameters={"g": G, "e": 0.5},
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-p.g,),
        contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution=restitution)],
        **given,
    )


def cradle(count, impacts="newton", e=1.0):
    """Balls of mass 1 and diameter 1 in a row."""
    return mechanics(
        coordinates=[f"x{i}" for i in range(count)],
        velocities=[f"v{i}" for i in range(count)],
        mass=lambda t, x, p: (1.0,) * count,
        forces=lambda t, x, p: (0.0,) * count,
        contacts=[
            Contact(f"c{i}", gap=lambda t, x, p, i=i: x[i + 1] - x[i] - 1.0, restitution=e)
            for i in range(count - 1)
        ],
        impacts=impacts,
    )


def touching(count, gap=0.0):
    """The first ball of a cradle flies with speed 1 to the others, which touch or have a small gap."""
    places = [-1.0, *(1.0 + i * (1.0 + gap) for i in range(count - 1))]
    return [*places, 1.0, *[0.0] * (count - 1)]


def block(friction="mu", static=None):
    """A block of mass 1 on a plane of some tilt, pulled by a spring, or carried by a belt."""
    return mechanics(
        coordinates=("x", "y"),
        velocities=("u", "v"),
        parameters={"mu": 0.3, "e": 0.0, "tilt": 0.0, "k": 0.0, "belt": 0.0},
        mass=lambda t, x, p: (1.0, 1.0),
        forces=lambda t, x, p: (G * np.sin(p.tilt) - p.k * x.x, -G * np.cos(p.tilt)),
        contacts=[
            Contact(
                "floor",
                gap=lambda t, x, p: x.y,
                slip=lambda t, x, p: x.u - p.belt,
                friction=friction,
                static=static,
                restitution="e",
            )
        ],
    )


BEAM = {"b": 1.0, "J": 0.9, "e": 0.3}


def beam():
    """A beam of mass 1 that falls onto its two feet."""
    return mechanics(
        coordinates=("y", "phi"),
        velocities=("v", "w"),
        parameters=BEAM,
        mass=lambda t, x, p: (1.0, p.J),
        forces=lambda t, x, p: (-G, 0.0),
        contacts=[
            Contact(name, gap=lambda t, x, p, s=s: x.y + s * p.b * x.phi, restitution="e")
            for name, s in (("left", -1.0), ("right", 1.0))
        ],
    )


def slender(b, h, friction=None):
    """A block of mass 1, width ``2 b`` and height ``2 h``, that stands on its two corners."""

    def corner(name, side):
        given = {}
        if friction is not None:
            given = {
                "slip": lambda t, x, p: x.u + (h * np.cos(x.phi) - side * b * np.sin(x.phi)) * x.w,
                "friction": friction,
            }
        return Contact(name, gap=lambda t, x, p: x.y - h * np.cos(x.phi) + side * b * np.sin(x.phi), **given)

    return mechanics(
        coordinates=("x", "y", "phi"),
        velocities=("u", "v", "w"),
        mass=lambda t, x, p: (1.0, 1.0, (b * b + h * h) / 3.0),
        forces=lambda t, x, p: (0.0, -G, 0.0),
        contacts=[corner("left", -1.0), corner("right", 1.0)],
    )


def rod(friction):
    """A rod of mass 1 and length 2 whose lower end slides on the floor, with Painleve's paradox."""
    return mechanics(
        coordinates=("x", "y", "phi"),
        velocities=("u", "v", "w"),
        parameters={"mu": friction},
        mass=lambda t, x, p: (1.0, 1.0, 1.0 / 3.0),
        forces=lambda t, x, p: (0.0, -G, 0.0),
        contacts=[
            Contact(
                "tip",
                gap=lambda t, x, p: x.y - np.sin(x.phi),
                slip=lambda t, x, p: x.u + np.sin(x.phi) * x.w,
                friction="mu",
            )
        ],
    )


A, K = 0.2, 2.0


def track(x, t=0.0):
    """Height of the track of `bead`."""
    return A * np.cos(K * x)


def bead():
    """A bead of mass 1 on a curved track."""
    return mechanics(
        coordinates=("x", "y"),
        velocities=("u", "v"),
        mass=lambda t, x, p: (1.0, 1.0),
        forces=lambda t, x, p: (0.0, -G),
        contacts=[Contact("track", gap=lambda t, x, p: x.y - A * np.cos(K * x.x))],
    )
