"""Circuits with ideal diodes whose currents and voltages have a closed form, or a simpler right-hand side."""

import numpy as np

from hybrid import Pair, complementarity


def is_on(t, p):
    """Whether the switch of the boost converter is closed."""
    return np.mod(t, p.T) < p.D * p.T


def half_wave():
    """A diode, a coil and a resistance at a sine; z is the voltage that the diode blocks."""
    return complementarity(
        state=("i",),
        parameters={"V": 1.0, "w": 1.0, "R": 1.0, "L": 1.0},
        rates=lambda t, x, z, p: ((p.V * np.sin(p.w * t) - p.R * x.i + z.diode) / p.L,),
        pairs=[Pair("diode", w=lambda t, x, z, p: x.i, says="blocks")],
        units={
            "t": "s",
            "i": "A",
            "V": "V",
            "w": "1/s",
            "R": "ohm",
            "L": "H",
            "diode.w": "A",
            "diode.z": "V",
        },
        period=lambda p: 2.0 * np.pi / p.w,
    )


def smoothed():
    """A diode with a resistance before a capacitor with a load; z is the current."""
    return complementarity(
        state=("v",),
        parameters={"V": 10.0, "Rs": 0.5, "R": 40.0, "C": 0.05},
        rates=lambda t, x, z, p: ((z.diode - x.v / p.R) / p.C,),
        pairs=[Pair("diode", w=lambda t, x, z, p: x.v - p.V * np.sin(t) + p.Rs * z.diode)],
    )


def bridge():
    """Four diodes at a sine with a resistance, before a capacitor with a load.

    The z of the upper diodes are their currents, those of the lower ones the voltages that they block.
    """

    def source(t, z, p):
        return (p.V * np.sin(t) - z.d3 + z.d4) / p.Rs

    return complementarity(
        state=("v",),
        parameters={"V": 10.0, "Rs": 0.5, "R": 40.0, "C": 0.05},
        rates=lambda t, x, z, p: ((z.d1 + z.d2 - x.v / p.R) / p.C,),
        pairs=[
            Pair("d1", w=lambda t, x, z, p: x.v - z.d3),
            Pair("d2", w=lambda t, x, z, p: x.v - z.d4),
            Pair("d3", w=lambda t, x, z, p: z.d1 - source(t, z, p)),
            Pair("d4", w=lambda t, x, z, p: z.d2 + source(t, z, p)),
        ],
    )


def battery():
    """Four diodes at a sine, before a coil with a resistance and a battery: the current may stop."""
    return complementarity(
        state=("i",),
        parameters={"V": 10.0, "E": 8.0, "R": 2.0, "L": 0.5},
        rates=lambda t, x, z, p: ((z.d1 + z.d3 - p.R * x.i - p.E) / p.L,),
        pairs=[
            Pair("d1", w=lambda t, x, z, p: x.i - z.d2),
            Pair("d2", w=lambda t, x, z, p: z.d1 + p.V * np.sin(t)),
            Pair("d3", w=lambda t, x, z, p: x.i - z.d4),
            Pair("d4", w=lambda t, x, z, p: z.d3 - p.V * np.sin(t)),
        ],
    )


def oscillator():
    """The oscillator with a bridge of four diodes of Acary and Brogliato (2008), chapter 1."""
    return complementarity(
        state=("v", "i"),
        parameters={"C": 1e-6, "L": 1e-2, "R": 1e3},
        rates=lambda t, x, z, p: ((-x.i - z.f1 + z.r2) / p.C, x.v / p.L),
        pairs=[
            Pair("r1", w=lambda t, x, z, p: (z.r1 + z.f2) / p.R - z.f1),
            Pair("f2", w=lambda t, x, z, p: (z.r1 + z.f2) / p.R - z.r2),
            Pair("f1", w=lambda t, x, z, p: z.r1 - x.v),
            Pair("r2", w=lambda t, x, z, p: z.f2 + x.v),
        ],
    )


def boost():
    """A boost converter with an ideal diode; the current stops where the load is light."""
    return complementarity(
        state=("i", "v"),
        parameters={"V": 12.0, "L": 1e-4, "C": 1e-4, "R": 100.0, "T": 1e-4, "D": 0.4},
        rates=lambda t, x, z, p: (
            np.where(is_on(t, p), p.V, p.V - x.v + z.diode) / p.L,
            (np.where(is_on(t, p), 0.0, x.i) - x.v / p.R) / p.C,
        ),
        pairs=[Pair("diode", w=lambda t, x, z, p: np.where(is_on(t, p), 1.0, x.i), says="blocks")],
        modes={"on": "mod(t/T,1)<D", "off": "mod(t/T,1)>D"},
        period=lambda p: p.T,
    )


def capacitors():
    """Two capacitors that a diode joins, of which the second has a load."""
    return complementarity(
        state=("v1", "v2"),
        parameters={"C1": 1.0, "C2": 3.0, "R": 2.0},
        rates=lambda t, x, z, p: (-z.d / p.C1, (z.d - x.v2 / p.R) / p.C2),
        pairs=[Pair("d", w=lambda t, x, z, p: x.v2 - x.v1)],
    )


def relay(sign=-1.0):
    """``x' = sign * sgn(x) + drive``; 1 - z.up is the sign of x."""
    return complementarity(
        state=("x",),
        parameters={"sign": sign, "drive": 0.0},
        rates=lambda t, x, z, p: (p.sign * (1.0 - z.up) + p.drive * t,),
        pairs=[
            Pair("up", w=lambda t, x, z, p: x.x + z.low),
            Pair("low", w=lambda t, x, z, p: 2.0 - z.up),
        ],
    )
