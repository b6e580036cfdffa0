"""Contact laws compared with an impact in closed form, and with each other where they must agree."""

import math
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest

import hybrid
import lyapunov
from models import vibroimpact
from models.contact import (
    Hertz,
    HuntCrossley,
    KelvinVoigt,
    Rigid,
    after_collision,
    hertz_stiffness,
    matched_laws,
)
from tests.reference.load import reference

K, SPEED = hertz_stiffness(), 0.4
M1, M2 = 1000.0, 100.0
MASS = M1 * M2 / (M1 + M2)
ALONE = {"omega1": 0.0, "omega2": 0.0, "P": 0.0}  # two free bodies without springs or drive
DEPTH = (5 * MASS * SPEED**2 / (4 * K)) ** 0.4
START = reference("founding_system")["D=0.05"]["x0"]
# Divergence of the springs and dampers, by which every law must contract volumes.
TRACE = reference("founding_system")["trace"]
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-15)

RESTITUTIONS = (1.0, 0.999, 0.8, 0.5, math.exp(-2), 0.1, 0.02)
CASES = [(name, law, e) for e in RESTITUTIONS for name, law in matched_laws(K, MASS, SPEED, e).items()]
every_law = pytest.mark.parametrize(
    ("law", "e"), [(law, e) for _, law, e in CASES], ids=[f"{name}-{e:.3g}" for name, _, e in CASES]
)


def impact(law, speed=SPEED, tangent=None):
    """The arc of one impact: body 1 moves at half the speed, body 2 against it, 1e-3 s before they touch."""
    x0 = (-1e-3 * speed, 0.0, speed / 2, -speed / 2)
    return hybrid.simulate(
        vibroimpact(law), x0, (0.0, 0.01), mode="free", parameters=ALONE, solver=TIGHT, tangent=tangent
    )


def energy(x):
    return M1 * x[2] ** 2 / 2 + M2 * x[3] ** 2 / 2


def hunt_crossley_restitution(alpha, speed):
    """From ``u - ln(1 + u) = -w - ln(1 - w)``, ``u = 3 alpha v / 2``, ``w = e u``, by Lambert's function."""
    u = mp.mpf(3) / 2 * alpha * speed
    y = -mp.lambertw(-mp.exp(-(u - mp.log(1 + u)) - 1)).real
    return float((1 - y) / u)


@every_law
def test_restitution_at_the_matched_speed(law, e):
    arc = impact(law)
    assert arc.status.ok
    assert arc.mode[-1] == "free"
    assert arc.x[-1, 2] - arc.x[-1, 3] == pytest.approx(-e * SPEED, rel=1e-8, abs=1e-10)


@every_law
def test_momentum_is_kept_and_energy_is_lost_to_the_restitution(law, e):
    before, after = impact(law).x[[0, -1]]
    assert M1 * after[2] + M2 * after[3] == pytest.approx(M1 * before[2] + M2 * before[3], rel=1e-10)
    assert energy(before) - energy(after) == pytest.approx(MASS * SPEED**2 * (1 - e**2) / 2, abs=1e-8)


def test_two_masses_after_a_collision():
    """A body stops at a collision with an equal mass, and rebounds from a heavy body with its speed."""
    assert after_collision(1.0, 1.0, 3.0, 0.0, 1.0) == pytest.approx((0.0, 3.0))
    assert after_collision(1.0, 1e12, 3.0, 0.0, 0.5) == pytest.approx((-1.5, 0.0), abs=1e-9)
    assert after_collision(2.0, 1.0, 3.0, 0.0, 0.0) == pytest.approx((2.0, 2.0))


def test_duration_of_a_hertz_contact():
    """Half of the duration leads to the deepest point, where the contact holds all the energy."""
    half = mp.quad(lambda s: 2 * s / mp.sqrt(1 - (1 - s * s) ** 2.5), [0, 1], method="gauss-legendre")
    exact = 2 * DEPTH / SPEED * half
    touch, leave = impact(Hertz(K)).jumps.t
    assert Hertz(K).duration(MASS, SPEED) == pytest.approx(float(exact), rel=1e-11)
    assert leave - touch == pytest.approx(float(exact), rel=1e-9)


@pytest.mark.parametrize("e", [0.8, 0.1])
def test_kelvin_voigt_lasts_as_long_at_any_speed_and_never_pulls(e):
    law = KelvinVoigt.from_restitution(e, MASS, Hertz(K).duration(MASS, SPEED))
    for speed in (SPEED, 3 * SPEED):
        arc = impact(law, speed)
        touch, release, parting = arc.jumps
        assert [jump.transition for jump in arc.jumps] == ["impact", "release", "parting"]
        assert release.t - touch.t == pytest.approx(Hertz(K).duration(MASS, SPEED), rel=1e-8)
        assert (parting.x_plus[2:] == release.x_minus[2:]).all()
        t = np.linspace(touch.t, release.t, 50)[:-1]
        x1, x2, v1, v2 = arc(t).T
        assert np.all(law.k * (x1 - x2) + law.c * (v1 - v2) > 0)
        assert v2[-1] - v1[-1] < e * speed


@pytest.mark.parametrize("speed", [0.1, 0.4, 1.6])
def test_hunt_crossley_at_any_speed(speed):
    """The restitution is one at zero speed and falls with the speed."""
    law = HuntCrossley.from_restitution(0.8, K, SPEED)
    arc = impact(law, speed)
    e = hunt_crossley_restitution(law.alpha, speed)
    assert arc.x[-1, 3] - arc.x[-1, 2] == pytest.approx(e * speed, rel=1e-8)


def test_hunt_crossley_loses_the_part_alpha_v_at_first_order():
    for e in (0.9, 0.99, 0.999):
        loss = HuntCrossley.from_restitution(e, K, SPEED).alpha * SPEED
        assert loss == pytest.approx(1 - e, abs=2 * (1 - e) ** 2)
    assert HuntCrossley.from_restitution(1.0, K, SPEED).alpha == 0.0


def test_pressed_bodies_come_to_rest_in_contact():
    """A negative gap presses them together: a Kelvin-Voigt contact opens and closes until they rest."""
    law = KelvinVoigt(k=1e5, c=300.0)
    system, D = vibroimpact(law), -0.5
    arc = hybrid.simulate(
        system, (-0.1, 0.0, 1.0, 0.0), (0.0, 120.0), mode="free", parameters={"P": 0.0, "D": D}
    )
    k1, k2 = M1 * 6.283**2, M2 * 5.646**2
    stiffness = np.array([[k1 + k2 + law.k, -k2 - law.k], [-k2 - law.k, k2 + law.k]])
    rest = np.linalg.solve(stiffness, (-k2 * D, k2 * D))
    assert {"impact", "release", "parting"} <= {jump.transition for jump in arc.jumps}
    assert arc.mode[-1] == "contact"
    np.testing.assert_allclose(arc.x[-1], (*rest, 0.0, 0.0), atol=1e-7)


def test_pressed_before_they_have_parted_they_are_in_contact_once_more():
    """With strong damping the surfaces are still dented when the force vanishes, and a force presses them."""
    law = KelvinVoigt(k=100.0, c=600.0)
    arc = hybrid.simulate(
        vibroimpact(law), (-0.1, 0.0, 6.0, 0.0), (0.0, 4.0), mode="free", parameters={"P": 0.0, "D": -0.5}
    )
    names = [jump.transition for jump in arc.jumps]
    assert "return" in names
    back = arc.jumps[names.index("return")].x_plus
    assert back[0] > back[1]
    assert law.k * (back[0] - back[1]) + law.c * (back[2] - back[3]) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("stiffened", "e"),
    [
        (lambda s: Hertz(s * K), 1.0),
        (lambda s: HuntCrossley.from_restitution(0.7, s * K, 0.40223315), 0.7),
        (lambda s: KelvinVoigt.from_restitution(0.7, MASS, Hertz(s * K).duration(MASS, SPEED)), 0.7),
    ],
    ids=["Hertz", "Hunt-Crossley", "Kelvin-Voigt"],
)
def test_stiff_contacts_tend_to_the_rigid_one(stiffened, e):
    """Matched at this impact speed, they differ by effects of the contact's duration, ``K^-0.4``."""
    span, stiffer = (0.0, 0.5), 10.0 ** np.array([2, 4, 6])
    rigid = hybrid.simulate(vibroimpact(Rigid(e)), START, span, solver=TIGHT).x[-1]
    ends = [hybrid.simulate(vibroimpact(stiffened(s)), START, span, mode="free").x[-1] for s in stiffer]
    errors = np.abs(ends - rigid).max(axis=1)
    slope = np.polyfit(np.log(stiffer), np.log(errors), 1)[0]
    assert slope == pytest.approx(-0.4, abs=0.03)
    assert errors[-1] < 1e-5


def test_exponents_of_stiff_elastic_contacts_tend_to_those_of_the_rigid_one():
    def exponents(law):
        orbit = hybrid.periodic_orbit(vibroimpact(law), START, mode="free")
        assert orbit.status.ok
        return np.sort(lyapunov.floquet_exponents(orbit))

    rigid = exponents(Rigid(1.0))
    errors = [np.abs(exponents(Hertz(s * K)) - rigid).max() for s in (1, 10, 100)]
    np.testing.assert_allclose(np.log10(np.divide(errors[:-1], errors[1:])), 0.4, atol=0.05)


@pytest.mark.parametrize("e", [1.0, 0.7])
def test_exponents_of_rigid_impacts_sum_to_what_restitution_and_damping_say(e):
    found = lyapunov.lyapunov_spectrum(vibroimpact(Rigid(e)), START, intervals=300)
    impacts = found.jumps_per_interval / found.interval
    assert impacts > 0
    assert found.exponents.sum() == pytest.approx(TRACE + 2 * impacts * math.log(e), abs=1e-9)


def test_hunt_crossley_contracts_half_as_much_again():
    """One impact contracts areas by ``(1 - e u) / (1 + u)``, while Newton's law gives ``e^2``."""
    law = HuntCrossley.from_restitution(0.8, K, SPEED)
    u = 1.5 * law.alpha * SPEED
    determinant = np.linalg.det(impact(law, tangent=True).fundamental)
    assert determinant == pytest.approx((1 - 0.8 * u) / (1 + u), rel=1e-8)
    assert math.log(determinant) / math.log(0.8**2) == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize("e", [0.0, -0.1, 1.1, math.nan])
def test_a_restitution_that_no_compliant_contact_has(e):
    with pytest.raises(hybrid.ArgumentError, match=r"^e must satisfy 0 < e <= 1 in a compliant.*; got"):
        matched_laws(K, MASS, SPEED, e)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.longdouble, np.array, Fraction])
def test_a_number_of_any_kind_is_computed_with_as_a_float(kind):
    """In numbers of half or single precision the results would have three or seven digits."""
    stiffness, part = 2.0**10, 0.75
    assert hertz_stiffness(E=kind(stiffness), nu=kind(part)) == hertz_stiffness(E=stiffness, nu=part)
    assert matched_laws(kind(stiffness), 3.0, 0.5, kind(part)) == matched_laws(stiffness, 3.0, 0.5, part)
    assert type(Rigid(kind(part)).e) is float


def test_the_stiffness_of_an_unsigned_integer_does_not_overflow():
    assert Hertz(np.uint64(2**63)).duration(1.0, 1.0) == pytest.approx(Hertz(2.0**63).duration(1.0, 1.0))


@pytest.mark.parametrize(("mass", "speed"), [(1e-3, 1e300), (1e300, 1e-300), (1e-300, 1e-200)])
def test_the_duration_of_an_impact_whose_energy_is_beyond_the_range_of_floats(mass, speed):
    exact = 1.6 * mp.sqrt(mp.pi) / 2 * mp.gamma(0.4) / mp.gamma(0.9)
    exact *= (mp.mpf(5) * mass * mp.mpf(speed) ** 2 / (4 * mp.mpf(1e8))) ** mp.mpf(0.4) / speed
    assert Hertz(1e8).duration(mass, speed) == pytest.approx(float(exact), rel=1e-12)


def test_a_law_that_no_float_can_hold_says_so():
    with pytest.raises(hybrid.ArgumentError, match="k is inf: the arguments are too large, too small"):
        KelvinVoigt.from_restitution(0.8, 90.0, 1e-300)
