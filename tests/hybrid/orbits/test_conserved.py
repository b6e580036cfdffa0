"""Families of orbits: conserved quantities are held at the guess; an orbit that is one of many says so."""

import attrs
import numpy as np
import pytest
from scipy.special import ellipk

import models
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition, continue_orbit, periodic_orbit

FAMILY = "The orbit is one of a family: a multiplier is 1"


def energy(t, x, p):
    return x.v**2 / 2 - np.cos(x.q)


def pendulum(**options):
    return HybridSystem(
        state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -np.sin(x.q)))], **options
    )


ENERGY = Laws(conserved={"energy": energy})


class TestPendulum:
    @pytest.mark.parametrize("q", [0.3, 1.2, 2.5])
    def test_the_orbit_has_the_energy_of_the_guess(self, q):
        """The guess of the period is off by 4 %, and the exact one is an elliptic integral."""
        exact = 4 * ellipk(np.sin(q / 2) ** 2)
        orbit = periodic_orbit(pendulum(laws=ENERGY), (q, 0.0), period=1.04 * exact)
        assert orbit.status.ok
        assert orbit.period == pytest.approx(exact, rel=1e-11)
        assert energy(0.0, np.rec.array(tuple(orbit.x0), names="q, v"), None) == pytest.approx(
            -np.cos(q), abs=1e-12
        )
        assert f"Held as at the guess: energy = {-np.cos(q):.9g}." in orbit.status.message
        assert FAMILY not in orbit.status.message

    def test_without_the_law_the_orbit_says_that_there_are_others(self):
        orbit = periodic_orbit(pendulum(), (1.2, 0.0), period=6.9)
        assert orbit.status.ok
        assert f"{FAMILY} besides that of the flow" in orbit.status.message
        assert "Laws(conserved=...)" in orbit.status.remedy
        assert FAMILY in repr(orbit)

    def test_a_period_that_is_given_may_decide_the_energy(self):
        """Declared as if it were forced with the period 8; the guess has another period, and so energy."""
        orbit = periodic_orbit(pendulum(laws=ENERGY, period=8.0), (1.7, 0.0))
        assert orbit.status.ok
        amplitude = np.arccos(-energy(0.0, np.rec.array(tuple(orbit.x0), names="q, v"), None))
        assert 4 * ellipk(np.sin(amplitude / 2) ** 2) == pytest.approx(8.0, rel=1e-9)


def test_a_branch_of_such_orbits_says_that_nothing_is_held():
    field = Mode("swing", lambda t, x, p: (x.v, -p.k * np.sin(x.q)))
    swing = HybridSystem(state=("q", "v"), parameters={"k": 1.0}, modes=[field])
    # Rounding decides which member of the family is next, so how far the steps lead is not asked.
    branch = continue_orbit(periodic_orbit(swing, (1.2, 0.0), period=6.9), "k", (0.9, 1.1), max_steps=100)
    assert "No conserved quantity is held" in branch.status.message
    alone = continue_orbit(periodic_orbit(kicked(), (1.9, 0.1), period=3.9), "e", (0.45, 0.55))
    assert "held" not in alone.status.message


@pytest.mark.parametrize("aside", [1e-6, 1e-5, 2e-5, 3e-5])
@pytest.mark.parametrize("speed", [0.7, 1.25, 2.0])
def test_a_particle_between_two_disks_keeps_the_speed_of_the_guess(speed, aside):
    """The speed across is nothing but rounding, which each period multiplies by 98."""
    disks = models.three_disk_billiard()
    orbit = periodic_orbit(disks, (0.1, -np.sqrt(3) + aside, speed, 1e-5), period=8 / speed * 1.02)
    assert orbit.status.ok
    assert np.hypot(*orbit.x0[2:]) == pytest.approx(speed, rel=1e-9)
    assert orbit.period == pytest.approx(8 / np.hypot(*orbit.x0[2:]), rel=1e-11)
    assert f"speed = {speed:.9g}" in orbit.status.message
    # Two reflections, each stretching by sigma - 1 + sqrt(sigma (sigma - 2)) with sigma = 6.
    assert orbit.multipliers[0] == pytest.approx((5 + np.sqrt(24)) ** 2, rel=1e-9)


def test_a_quantity_of_a_mode_whose_formula_changes_from_mode_to_mode():
    """The energy of the hopper has a formula in the air and another one on the leg."""
    x0 = (0.0, 0.94, np.sqrt(5.0**2 + 2 * 9.81 * 0.06), -1e-3)
    orbit = periodic_orbit(models.slip_hopper(), x0, mode="descent", period=0.25)
    assert "Held as at the guess: energy = " in orbit.status.message


def kicked(**options):
    """A ball whose floor gives back a share of the speed and adds 1: the speed there is 1 / (1 - e)."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"e": 0.5},
        modes=[Mode("flight", lambda t, x, p: (x.v, -1.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: {"v": -p.e * x.v + 1.0}),
                name="floor",
            )
        ],
        **options,
    )


def test_a_quantity_that_the_jumps_change_is_not_held():
    laws = Laws(conserved={"flight": {"energy": lambda t, x, p: x.v**2 / 2 + x.q}})
    orbit = periodic_orbit(kicked(laws=laws), (1.9, 0.1), period=3.9)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(4.0, rel=1e-11)
    assert orbit.status.message == "Reached the end."


def test_an_isolated_orbit_is_not_one_of_many():
    assert periodic_orbit(kicked(), (1.9, 0.1), period=3.9).status.message == "Reached the end."


def test_a_second_quantity_is_still_free():
    """Two uncoupled oscillators of the same frequency: their energies, and their phases to each other."""

    def of(i):
        return lambda t, x, p: x[2 * i] ** 2 + x[2 * i + 1] ** 2

    def field(t, x, p):
        return x[1], -x[0], x[3], -x[2]

    pair = HybridSystem(
        state=4, modes=[Mode("m", field)], laws=Laws(conserved={"first": of(0), "second": of(1)})
    )
    guess = (1.0, 0.1, 0.0, 2.0)
    orbit = periodic_orbit(pair, guess, period=6.2)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(2 * np.pi, rel=1e-12)
    assert "first = 1.01, second = 4" in orbit.status.message
    assert FAMILY in orbit.status.message
    phase = Laws(conserved={"phase": lambda t, x, p: x[0] * x[3] - x[1] * x[2]})
    orbit = periodic_orbit(attrs.evolve(pair, laws=pair.laws.joined(phase)), guess, period=6.2)
    assert FAMILY not in orbit.status.message
