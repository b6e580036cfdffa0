"""Exponents of systems with members of a repeat: parameters of one and of all, and rates per transition."""

import numpy as np
import pytest

import lyapunov
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition, repeat

START = {"map.u": [0.1, 0.2]}


def expanding():
    """Two cells that grow, each at a rate of its own, and lose a half at 1."""
    maps = repeat(
        "map",
        2,
        state=("u",),
        parameters={"rate": [0.5, 0.8]},
        field=lambda t, x, p, i: {"u": p.map[i].rate * x.map[i].u},
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p, i: x.map[i].u - 1.0, +1),
                Reset(lambda t, x, p, i: {"u": x.map[i].u - 0.5}),
                name="drop",
            )
        ],
    )
    return HybridSystem(repeats=[maps], modes=[Mode("run", lambda t, x, p: ())])


def test_a_chart_over_a_parameter_of_all_members_and_of_one():
    options = {"k": 2, "intervals": 60, "interval": 1.0, "transient": 5, "progress": False}
    chart = lyapunov.chart(expanding(), {"map.rate": [0.4, 0.7], "map[1].rate": [0.3, 0.9]}, START, **options)
    for i, both in enumerate((0.4, 0.7)):
        for j, own in enumerate((0.3, 0.9)):
            point = {"map[0].rate": both, "map[1].rate": own}
            alone = lyapunov.chart(
                expanding(), {name: [value] for name, value in point.items()}, START, **options
            )
            np.testing.assert_allclose(chart.exponents[i, j], alone.exponents[0, 0], atol=1e-9)


def test_a_name_of_all_members_is_refused_beside_one_of_them_in_parameters():
    with pytest.raises(ArgumentError, match=r"Parameter 'map\.rate' is given twice"):
        lyapunov.chart(
            expanding(),
            {"map.rate": [0.4]},
            START,
            parameters={"map[0].rate": 0.5},
            intervals=5,
            interval=1.0,
            progress=False,
        )


def test_rates_per_transition_of_all_members():
    spectrum = lyapunov.lyapunov_spectrum(expanding(), START, intervals=200, interval=1.0, transient=5)
    times = {name: spectrum.per(name).time for name in ("map[0].drop", "map[1].drop", "map.drop")}
    # From 1/2 to 1 takes ln 2 / rate.
    assert times["map[0].drop"] == pytest.approx(np.log(2) / 0.5, rel=0.02)
    assert 1 / times["map.drop"] == pytest.approx(
        1 / times["map[0].drop"] + 1 / times["map[1].drop"], rel=1e-9
    )
