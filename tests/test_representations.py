"""What results show of themselves, in a terminal and in a notebook."""

import re

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import hybrid
import hybrid.plot
import lyapunov
import models

BALL = models.bouncing_ball()


def test_one_jump_is_singular():
    one, two = (hybrid.simulate(BALL, (1.0, 0.0), (0.0, end)) for end in (0.5, 1.2))
    assert (repr(one), repr(one.jumps)) == ("<HybridArc t = 0 to 0.5, 1 jump, SUCCESS>", "<1 jump>")
    assert repr(two.jumps) == "<2 jumps>"


def test_an_orbit_shows_its_transitions_and_the_sign_of_its_multiplier():
    orbit = hybrid.periodic_orbit(
        models.simplest_walker(), (0.2003, 0.4006, -0.1998, -0.0158), mode="behind", period=3.88
    )
    assert sorted(orbit.transitions) == ["heelstrike", "passing"]
    shown = "<PeriodicOrbit period 3.88246375 from 'behind' through 'heelstrike', 'passing', largest "
    assert repr(orbit).startswith(f"{shown}multiplier 1,")
    pair = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    assert re.search(r"through 'impact', largest multiplier -0\.584295 \+- 0\.0056\d*i,", repr(pair))
    flipped = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0), parameters={"r": 0.3})
    assert "largest multiplier -" in repr(flipped)


def test_a_point_that_is_no_orbit_does_not_look_like_one():
    """Its line, its picture and its exponents say so; the numbers of the best point are kept."""
    point = hybrid.periodic_orbit(models.impact_oscillator(), (0.0, 0.0), max_iterations=1)
    assert repr(point).startswith(
        f"<PeriodicOrbit NOT CONVERGED, residual {point.residual:.1e} after a period "
    )
    assert "multiplier" not in repr(point)
    title = hybrid.plot.plot_orbit(point).get_title(loc="left")
    assert title.startswith("NOT CONVERGED, residual ")
    with pytest.raises(hybrid.ArgumentError, match="orbit has not converged: Newton's method did not"):
        lyapunov.floquet_exponents(point)
    assert np.all(np.isfinite(point.multipliers))
    solver = hybrid.DOP853(max_steps=5)
    ended = hybrid.periodic_orbit(models.impact_oscillator(), (0.0, 0.0), solver=solver)
    assert repr(ended).startswith("<PeriodicOrbit NO ORBIT, MAX_STEPS, residual ")


def test_a_system_shows_a_number_for_its_period():
    text = repr(models.impact_oscillator())
    assert "modes: 'flight'" in text
    assert "period: 6.28319, a function of the parameters" in text


def test_a_spectrum_without_intervals_says_why_and_what_to_do():
    spectrum = lyapunov.lyapunov_spectrum(BALL, (1.0, 0.0), intervals=20)
    assert spectrum.intervals == 0
    assert "without a complete interval, ACCUMULATION" in repr(spectrum)
    assert "accumulates_to=" in repr(spectrum)


@pytest.mark.parametrize(
    ("result", "texts"),
    [
        (lambda: hybrid.simulate(BALL, (1.0, 0.0), (0.0, 1.2)), ["2 jumps, SUCCESS", "<td>flight</td>"]),
        (lambda: hybrid.simulate(BALL, (1.0, 0.0), (0.0, 1.2)).jumps, ["<td>bounce</td>", "<th>kind</th>"]),
        (lambda: hybrid.simulate(BALL, (1.0, 0.0), (0.0, 4.06)).jumps, ["more</p>"]),
        (
            lambda: hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0)),
            ["<th>modulus</th>", "<td>-0.584295 +0.0056", "at t = 0: x = "],
        ),
        (
            lambda: lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), intervals=5),
            ["<td>sum rule</td>", "5 intervals of 6.28319. SUCCESS"],
        ),
    ],
)
def test_a_notebook_gets_a_table(result, texts):
    html = result()._repr_html_()
    assert html.count("<table>") == html.count("</table>") == 1
    for text in texts:
        assert text in html
