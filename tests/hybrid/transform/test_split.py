"""Plain equations split into modes: what is found, how it is named, and that the runs are right."""

import pickle

import numpy as np
import pytest

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, ModelError, Transition, from_equations, simulate, split
from hybrid.status import StatusCode
from lyapunov import lyapunov_spectrum
from tests.reference.plain_models import PLAIN, pair

PLANE = ("q", "v")


def plain(field, parameters=None, state=PLANE, transitions=(), period=None):
    return HybridSystem(
        state=state,
        parameters=parameters or {},
        modes=[Mode("plain", field)],
        transitions=transitions,
        period=period,
    )


@pytest.mark.parametrize("name", sorted(PLAIN))
def test_plain_equations_give_what_the_model_gives(name):
    """Arcs, jumps, tangent vectors and exponents, to rounding."""
    x0, end, interval = PLAIN[name].x0, PLAIN[name].end, PLAIN[name].interval
    model, found = pair(name)
    by_hand, by_split = (simulate(each, x0, (0.0, end), tangent=True) for each in (model, found))
    assert by_split.status.code is by_hand.status.code
    assert len(by_split.jumps) == len(by_hand.jumps) > 2
    np.testing.assert_allclose(by_split.jumps.t, by_hand.jumps.t, rtol=1e-12)
    np.testing.assert_allclose(by_split.x[-1], by_hand.x[-1], rtol=1e-9, atol=1e-12)
    size = np.abs(by_hand.fundamental).max()
    np.testing.assert_allclose(by_split.fundamental, by_hand.fundamental, atol=1e-8 * size)
    # Two ways to write a field differ in rounding, and a chaotic orbit forgets where it started.
    short = {"intervals": 20, "transient": 0} if name == "chua_circuit" else {"intervals": 50}
    one, other = (lyapunov_spectrum(each, x0, interval=interval, **short) for each in (model, found))
    finite = np.isfinite(one.exponents)
    np.testing.assert_allclose(other.exponents[finite], one.exponents[finite], rtol=1e-8, atol=1e-8)
    assert np.array_equal(np.isneginf(other.exponents), np.isneginf(one.exponents))


class TestNames:
    def test_sides_and_sliding(self):
        block = from_equations(lambda t, x, p: (x.v, -x.q - np.sign(x.v)), state=PLANE)
        assert block.mode_names == ("v<0", "v>0", "v=0")
        assert all(mode.part_of == "smooth" for mode in block.modes)

    def test_parameters_on_the_right(self):
        field = lambda t, x, p: (x.v, -np.maximum(x.q - p.gap, 0.0))  # noqa: E731
        assert from_equations(field, state=PLANE, parameters={"gap": 0.1}).mode_names == ("q<gap", "q>gap")

    def test_a_number_is_short(self):
        assert from_equations(lambda t, x, p: (x.v, -np.abs(x.q - 0.3)), state=PLANE).mode_names == (
            "q<0.3",
            "q>0.3",
        )

    def test_a_long_one_is_explained(self):
        field = lambda t, x, p: (x.v, -np.abs(x.q**3 + 2 * x.v**3 - 0.1 * x.q * x.v**2 + x.v + x.q))  # noqa: E731
        system = from_equations(field, state=PLANE)
        assert system.mode_names == ("h1<0", "h1>0")
        assert "h1 = q+q^3+v+2*v^3-0.1*q*v^2" in repr(system)

    def test_the_users_mode_comes_first_if_there_are_several(self):
        system = split(two_springs())
        assert system.mode_names == ("low: v<0", "low: v>0", "high")
        assert [mode.part_of for mode in system.modes] == ["low", "low", "high"]

    def test_jumps_and_arcs_are_grouped_by_the_users_names(self):
        arc = simulate(split(two_springs()), (0.0, 1.0), (0.0, 6.0), mode="low")
        assert set(arc.part_of) == {"low", "high"}
        assert [jump.transition for jump in arc.jumps["up"]] == ["up (v>0)"]
        assert len(arc.jumps["down"]) == 1

    def test_remainders(self):
        wave = from_equations(lambda t, x, p: (x.v, np.where(np.mod(t, 2.0) < 0.5, 1.0, 0.0)), state=PLANE)
        assert all("mod(t/2,1)" in name for name in wave.mode_names)


def two_springs():
    return HybridSystem(
        state=PLANE,
        modes=[
            Mode("low", lambda t, x, p: (x.v, -0.5 * np.abs(x.v) - x.q)),
            Mode("high", lambda t, x, p: (x.v, -2.0 * x.q)),
        ],
        transitions=[
            Transition("low", "high", Guard(lambda t, x, p: x.q - 0.3, +1), name="up"),
            Transition("high", "low", Guard(lambda t, x, p: x.q - 0.3, -1), name="down"),
        ],
    )


class TestStarts:
    def test_the_users_mode_may_be_named(self):
        arc = simulate(split(two_springs()), (0.0, -1.0), (0.0, 0.1), mode="low")
        assert arc.mode[0] == "low: v<0"

    def test_beyond_a_guard_of_the_users(self):
        arc = simulate(split(two_springs()), (0.5, -1.0), (0.0, 0.1), mode="low")
        assert arc.mode[0] == "low: v<0"
        assert "beyond the guard of 'up'," in arc.status.message

    def test_on_a_surface(self):
        block = from_equations(lambda t, x, p: (x.v, -x.q - np.sign(x.v)), state=PLANE)
        assert simulate(block, (0.5, 0.0), (0.0, 1.0)).mode[0] == "v=0"
        assert simulate(block, (2.0, 0.0), (0.0, 0.1)).mode[-1] == "v<0"

    def test_where_another_mode_has_no_values(self):
        """Guards of modes that the state does not belong to may be undefined there."""
        root = from_equations(
            lambda t, x, p: (x.v, np.cos(2 * t) - x.q - 0.3 * np.sign(x.v) * np.sqrt(np.abs(x.v) + 1e-3)),
            state=PLANE,
        )
        assert simulate(root, (0.1, 0.4), (0.0, 5.0)).status.ok


class TestSurfaces:
    def count(self, field, parameters=None):
        return len(from_equations(field, state=PLANE, parameters=parameters).mode_names)

    def test_a_function_written_twice_counts_once(self):
        assert self.count(lambda t, x, p: (x.v, -np.abs(x.q - 1) - np.sign(2 - 2 * x.q) * x.v**2)) == 2

    def test_parallel_surfaces_leave_out_what_cannot_be(self):
        assert self.count(lambda t, x, p: (x.v, -np.clip(x.q, -1.0, 1.0))) == 3

    def test_a_jump_that_no_speed_feels_is_crossed(self):
        """A force that jumps with the position cannot hold the position."""
        assert self.count(lambda t, x, p: (x.v, -np.sign(x.q))) == 2

    def test_known_factors_are_left_out(self):
        """The force of a contact with damping is not below zero; its sign is that of one factor."""

        def field(t, x, p):
            hertz = 20 * np.maximum(x.q - 0.3, 0.0) ** 1.5
            return x.v, np.cos(t) - x.q - np.maximum(hertz * (1 + 2.5 * x.v), 0.0)

        system = from_equations(field, state=PLANE)
        assert system.mode_names == ("q<0.3", "q>0.3, v<-0.4", "q>0.3, v>-0.4")
        direct = simulate(
            plain(field), (0.1, 1.0), (0.0, 10.0), solver=hybrid.DOP853(rtol=1e-11, atol=1e-13, max_step=1e-2)
        )
        np.testing.assert_allclose(simulate(system, (0.1, 1.0), (0.0, 10.0)).x[-1], direct.x[-1], atol=1e-9)

    def test_nested_choices(self):
        def field(t, x, p):
            inner = np.where((x.q > 0.2) & ~(x.v < 0) | (x.q < -1), -1.5, np.minimum(x.v, 0.5))
            return x.v, inner - x.q + np.cos(t)

        system = from_equations(field, state=PLANE)
        arc = simulate(system, (0.3, 1.0), (0.0, 10.0))
        assert len(arc.jumps) > 4
        for i in np.flatnonzero(np.diff(arc.t) > 1e-6):
            t, mode = (
                0.5 * (arc.t[i] + arc.t[i + 1]),
                arc.system.modes[arc.system.mode_index(str(arc.mode[i]))],
            )
            x = arc.system.variables.state_view(arc(t))
            np.testing.assert_allclose(
                np.array(mode.field(t, x, ()), float), np.array(field(t, x, ()), float), atol=1e-12
            )


class TestClocks:
    @pytest.mark.parametrize("period", [None, 2.0])
    def test_a_square_wave(self, period):
        """A constant force that is switched on for a quarter of each period, by its exact solution."""
        push = from_equations(
            lambda t, x, p: (x.v, np.where(np.mod(t, 2.0) < 0.5, 1.0, 0.0)), state=PLANE, period=period
        )
        arc = simulate(push, (0.0, 0.0), (0.0, 10.0))
        assert arc.x[-1, 1] == pytest.approx(2.5, abs=1e-13)
        # In period k it starts with speed k/2, and a push adds 1/8 and then 3/2 times 1/2 to the way.
        assert arc.x[-1, 0] == pytest.approx(sum(2.0 * k / 2 + 0.125 + 0.75 for k in range(5)), abs=1e-12)

    def test_steps_of_a_floor(self):
        """Step k takes k times as long as the first."""
        stairs = from_equations(lambda t, x, p: (1.0 / (1.0 + np.floor(x.q)),), state=("q",))
        arc = simulate(stairs, (0.5,), (0.0, 10.0))
        whole = np.abs(np.sin(np.pi * arc.jumps.x_minus[:, 0])) < 0.1
        np.testing.assert_allclose(arc.jumps.t[whole], [0.5, 2.5, 5.5, 9.5], rtol=1e-12)


class TestSliding:
    def test_two_surfaces_by_the_closed_form(self):
        """Both coordinates are driven to zero; on the intersection the third moves with the mean slope.

        The jumps add up, so the shares are ``a = sin(t)/2`` and ``b = cos(t)/2``, and ``z' = a + 2 b``.
        """

        def field(t, x, p):
            a, b = np.sign(x.x), np.sign(x.y)
            return 0.5 * np.sin(t) - a, 0.5 * np.cos(t) - b, a + 2 * b

        system = from_equations(field, state=("x", "y", "z"))
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 6.0))
        assert set(arc.mode) == {"x=0, y=0"}
        exact = 0.5 * (1 - np.cos(arc.t)) + np.sin(arc.t)
        np.testing.assert_allclose(arc["z"], exact, atol=1e-11)

    def test_two_surfaces_whose_jumps_do_not_add_up(self):
        """The bilinear combination: ``0 = 0.3 a b - 0.1 - a`` and ``0 = 0.2 - b`` give b = 1/5, a = -5/47."""

        def field(t, x, p):
            a, b = np.sign(x.x), np.sign(x.y)
            return 0.3 * a * b - 0.1 - a, 0.2 - b, a + 10 * a * b

        system = from_equations(field, state=("x", "y", "z"))
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 2.0))
        assert set(arc.mode) == {"x=0, y=0"}
        assert arc["z"][-1] == pytest.approx(2.0 * -5 / 47 * (1 + 10 / 5), abs=1e-12)

    @pytest.mark.parametrize("e", [0.0, 1e-12, 1e-6])
    def test_no_digits_are_lost_where_the_quadratic_of_the_shares_has_a_root_at_zero(self, e):
        """``0 = e - a + b/2`` and ``0 = a (1 - 2 b)``: b = 1/2 is stable, and the other root is 0."""

        def field(t, x, p):
            a, b = np.sign(x.x), np.sign(x.y)
            return p.e - a + 0.5 * b, a - 2 * a * b, a + 10 * b

        system = from_equations(field, state=("x", "y", "z"), parameters={"e": e})
        arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 2.0), mode="x=0, y=0")
        assert arc.status.ok
        assert arc["z"][-1] == pytest.approx(2.0 * (0.25 + e + 5.0), abs=1e-13)

    def test_a_repelling_surface_ends_the_run(self):
        away = from_equations(lambda t, x, p: (1.0 + 0 * x.q, np.sign(x.v)), state=PLANE)
        with pytest.raises(hybrid.HybridError, match="more than one mode: v<0, v>0"):
            simulate(away, (0.0, 0.0), (0.0, 1.0))
        arc = simulate(away, (0.0, 0.0), (0.0, 1.0), mode="v=0")
        assert arc.status.code is StatusCode.TERMINAL
        assert "two-fold at start" in arc.jumps.transition[-1]

    def test_multipliers_of_a_block_on_a_belt(self):
        """One direction of the orbit is forgotten in each stick: the multipliers are 1 and 0."""
        p = models.stick_slip().parameters
        block = from_equations(PLAIN["stick_slip"].field, state=("x", "v"), parameters=p)
        run = simulate(block, (0.3, 0.1), (0.0, 60.0))
        start = run.jumps["v=belt->v<belt"][-1]
        period = np.diff([jump.t for jump in run.jumps["v=belt->v<belt"]])[-1]
        orbit = hybrid.periodic_orbit(block, start.x_plus, mode="v<belt", period=period)
        np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), [0.0, 1.0], atol=1e-8)

    @pytest.mark.parametrize(("w", "friction"), [(0.8, 0.4), (2.0, 0.3), (0.7, 0.1)])
    def test_amplitude_of_den_hartog(self, w, friction):
        """Forced dry friction without stops: the amplitude of J. P. Den Hartog, 1931, in closed form.

        ``x/a = sqrt(V^2 - (S f)^2)`` with ``V = 1/(1-w^2)``, ``S = sin(pi/w) / (w (1+cos(pi/w)))``.
        """
        system = from_equations(
            lambda t, x, p: (x.v, np.cos(p.w * t) - x.q - p.f * np.sign(x.v)),
            state=PLANE,
            parameters={"w": w, "f": friction},
            period=lambda p: 2 * np.pi / p.w,
        )
        V = 1 / (1 - w**2)
        S = np.sin(np.pi / w) / (w * (1 + np.cos(np.pi / w)))
        amplitude = np.sqrt(V**2 - (S * friction) ** 2)
        arc = simulate(system, (1.0, 0.0), (0.0, 400 * 2 * np.pi / w))
        turns = arc.jumps.x_minus[:, 0][-2:]
        np.testing.assert_allclose(np.abs(turns), amplitude, rtol=1e-8)


class TestErrors:
    def test_a_field_that_cannot_be_traced(self):
        with pytest.raises(
            ModelError, match=r"split: the field of mode 'm' .*np.where\(x.v > 0, 1.0, -1.0\)"
        ):
            split(
                HybridSystem(state=PLANE, modes=[Mode("m", lambda t, x, p: (x.v, 1.0 if x.v > 0 else -1.0))])
            )

    def test_not_a_system(self):
        with pytest.raises(hybrid.HybridError, match="split: system"):
            split("oscillator")

    def test_a_part_with_other_values_is_refused(self, monkeypatch):
        """If the parts did not add up to the user's field, the split would say so."""
        from hybrid.transform.cells import Pieces

        whole = Pieces.flow
        monkeypatch.setattr(
            Pieces, "flow", lambda self, sides: lambda t, x, p: [2 * v for v in whole(self, sides)(t, x, p)]
        )
        with pytest.raises(ModelError, match="has other values than its field"):
            split(plain(lambda t, x, p: (x.v, -np.abs(x.q))))


def friction_chain(t, x, p):
    """Three blocks in a row on a belt, which makes 27 modes."""
    q, v = x[:3], x[3:]
    pulls = [-q[i] - 0.5 * (2 * q[i] - q[max(i - 1, 0)] - q[min(i + 1, 2)]) for i in range(3)]
    return [*v, *(pulls[i] - (1.0 + 0.1 * i) * np.sign(v[i] - p.belt) for i in range(3))]


@pytest.fixture(scope="module")
def chain():
    return from_equations(friction_chain, state=6, parameters={"belt": 0.2})


def test_units_are_those_of_the_split_system():
    units = {"q": "m", "v": "m/s", "t": "s"}
    system = from_equations(lambda t, x, p: (x.v, -x.q - np.sign(x.v)), state=("q", "v"), units=units)
    assert dict(system.units) == units
    arc = simulate(system, (2.0, 0.0), (0.0, 1.0))
    assert arc.to_xarray().t.attrs["units"] == "s"


class TestStages:
    def test_a_large_system_shows_a_few_modes(self, chain):
        assert chain.growth is not None
        assert len(chain.modes) < 12
        assert "A run adds the modes that it needs." in repr(chain)

    def test_a_run_has_the_modes_that_it_visits(self, chain):
        """Blocks that all move with the belt: each slips where its spring overcomes the friction."""
        x0 = np.r_[np.linspace(0.1, 0.4, 3), np.full(3, 0.2)]
        arc = simulate(chain, x0, (0.0, 6.0))
        assert arc.status.ok
        assert arc.mode[0] == "x3=belt, x4=belt, x5=belt"
        assert set(arc.mode) <= set(arc.system.mode_names)
        assert len(arc.jumps) >= 1
        # The first to slip is the one whose pull reaches its friction first, with all at the belt's speed.
        t = arc.jumps.t[0]
        q = x0[:3] + 0.2 * t
        pulls = [q[i] + 0.5 * (2 * q[i] - q[max(i - 1, 0)] - q[min(i + 1, 2)]) for i in range(3)]
        shares = np.array(pulls) / (1.0 + 0.1 * np.arange(3))
        assert shares.max() == pytest.approx(1.0, abs=1e-12)

    def test_it_can_be_pickled(self, chain):
        copy = pickle.loads(pickle.dumps(chain))
        assert copy.growth is not None
        x0 = np.r_[np.linspace(0.1, 0.4, 3), np.full(3, 0.2)]
        one, other = (simulate(each, x0, (0.0, 1.0)) for each in (chain, copy))
        np.testing.assert_array_equal(one.x[-1], other.x[-1])
