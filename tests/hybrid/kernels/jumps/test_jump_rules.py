"""A jump, rule by rule: its matrix, what is asked and counted in which kind of run, and a limit at once."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import jump
from hybrid.kernels.types.codes import ENTERING, GRAZING, NO_MODE, NO_TRANSITION, TRANSVERSE
from tests.hybrid.kernels.plain import plain


class Recorder:
    """Stubs that note the names of what is called, and some of the arguments."""

    def __init__(self):
        self.calls = []

    def stub(self, name, answer=None, kept=()):
        def call(*given):
            self.calls.append((name, *(given[i] for i in kept)) if kept else name)
            return answer

        return call


# The first two components of ``x``: rates before ``(y, -2 x)``, after ``(-1, x y)``; time is 1/5.
BEFORE, T = np.array([0.3, 0.7]), 0.2
MATRIX, RATE = np.array([[0.5, -1.0], [2.0, 1.0]]), np.array([0.0, 3.0])


class Model:
    """Transition 1 leads from mode 0 to mode 2."""

    dimension = 2
    parameters = "p"
    field_before, field_behind = np.array([9, 0]), np.array([9, 2])

    def __init__(self, gradient=(3.0, -1.4, 0.5)):
        self.gradient = gradient

    def field(self, mode, t, x, parameters, out):
        assert (t, parameters) == (T, "p")
        out[:] = (x[1], -2.0 * x[0]) if mode == 0 else (-1.0, x[0] * x[1])

    def guard_gradient(self, transition, t, x, parameters, out):
        assert (transition, t, x.tolist()) == (1, T, BEFORE.tolist())
        out[:] = self.gradient

    def reset(self, transition, t, x, parameters, out):
        assert (transition, t) == (1, T)
        out[:] = MATRIX @ x + RATE * t

    def reset_jacobian(self, transition, t, x, parameters, out):
        assert (transition, t, x.tolist()) == (1, T, BEFORE.tolist())
        out[:, :2], out[:, 2] = MATRIX, RATE


def memory():
    names = ("field", "field_after", "settled", "new", "state")
    return SimpleNamespace(
        **{name: np.full(2, 88.0) for name in names},
        gradient=np.full(3, 88.0),
        reset_jacobian=np.full((2, 3), 88.0),
        **{name: np.full((2, 2), 88.0) for name in ("saltation", "sizes", "rounding")},
    )


AFTER = MATRIX @ BEFORE + RATE * T
RATES_BEFORE, RATES_AFTER = np.array([0.7, -0.6]), np.array([-1.0, AFTER[0] * AFTER[1]])


class TestMatrix:
    def test_terms_of_a_crossing(self):
        work, x_plus = memory(), np.zeros(2)
        speed = plain(jump).cross(Model(), 1, 0, 2, T, BEFORE, x_plus, work)
        assert speed == pytest.approx(0.5 + 3.0 * 0.7 + 1.4 * 0.6, rel=1e-15)
        assert x_plus == pytest.approx(AFTER, rel=1e-15)
        excess = RATES_AFTER - MATRIX @ RATES_BEFORE - RATE
        assert work.settled == pytest.approx(excess, rel=1e-14)
        # A run that ends stays where it is.
        plain(jump).cross(Model(), 1, 0, NO_MODE, T, BEFORE, x_plus, work)
        assert work.settled == pytest.approx(-MATRIX @ RATES_BEFORE - RATE, rel=1e-14)

    @pytest.mark.parametrize("found", [False, True])
    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_the_matrix_and_the_sizes_of_its_terms(self, found, way):
        """Where a surface is found its gradient is one per unit of speed."""
        gradient = way * np.array([3.0, -1.4, 0.5])
        speed = 1.0 if found else way * 3.44
        work, x_plus = memory(), np.zeros(2)
        tested = plain(jump, finds_surface=lambda *given: found)
        answer = tested.saltation(Model(gradient), 1, T, BEFORE, x_plus, work)
        assert answer == pytest.approx(way * 3.44, rel=1e-14)
        excess = RATES_AFTER - MATRIX @ RATES_BEFORE - RATE
        expected = MATRIX + np.outer(excess, gradient[:2]) / speed
        np.testing.assert_allclose(work.saltation, expected, rtol=1e-13)
        terms = np.abs(RATES_AFTER) + RATE + np.abs(MATRIX) @ np.abs(RATES_BEFORE)
        sizes = np.abs(MATRIX) + np.outer(terms, np.abs(gradient[:2])) / abs(speed)
        np.testing.assert_allclose(work.sizes, sizes, rtol=1e-13)

    def test_a_guard_that_does_not_depend_on_a_component(self):
        """Also where its speed is zero: then the other entries are not finite."""
        work = memory()
        tested = plain(jump, finds_surface=lambda *given: False)
        with np.errstate(divide="ignore"):
            tested.saltation(Model((6.0, 7.0, 0.0)), 1, T, BEFORE, np.zeros(2), work)
            assert np.all(np.isfinite(work.saltation))
            tested.saltation(Model((0.0, 1.0, 0.6)), 1, T, BEFORE, np.zeros(2), work)
        np.testing.assert_array_equal(work.saltation[:, 0], MATRIX[:, 0])
        np.testing.assert_array_equal(work.sizes[:, 0], np.abs(MATRIX[:, 0]))
        assert not np.any(np.isfinite(work.saltation[:, 1]))

    def test_sizes_that_are_not_known_are_the_largest(self):
        work = memory()
        work.saltation[:] = (0.5, -3.0), (2.0, 1.0)
        plain(jump).assume_sizes(2, work)
        assert work.sizes.tolist() == [[3.0, 3.0], [3.0, 3.0]]
        work.saltation[:] = 0.0
        plain(jump).assume_sizes(2, work)
        assert work.sizes.tolist() == [[0.0, 0.0], [0.0, 0.0]]


class TestCrossings:
    def run(self, **values):
        given = {"phase": T, "y": np.array([0.3, 0.7]), "mode": 0, "map_is_known": 0, "last_fired": 1}
        return SimpleNamespace(**(given | values))

    @pytest.mark.parametrize(
        ("mode", "target", "marker", "rates"),
        [(0, 0, 0, True), (0, 0, 1, False), (0, 2, 0, False)],
    )
    def test_without_a_matrix(self, mode, target, marker, rates):
        """Rates after the jump are needed where a chatter may begin."""
        model, work, said = Model(), memory(), Recorder()
        model.target, model.marker = np.array([9, target]), np.array([9, marker])
        tested = plain(jump, postpone_map=said.stub("postpone", kept=(1,)))
        speed = tested.cross_without_map(model, self.run(), 1, mode, work)
        assert speed == pytest.approx(3.44, rel=1e-14)
        assert work.new == pytest.approx(AFTER, rel=1e-15)
        assert work.field_after.tolist() == ([AFTER[1], -2.0 * AFTER[0]] if rates else [88.0, 88.0])
        assert said.calls == [("postpone", 2)]

    def test_with_a_matrix(self):
        said = Recorder()
        tested = plain(
            jump,
            saltation=said.stub("saltation", 7.0, kept=(1, 2)),
            change_of_instant=said.stub("instant", kept=(1,)),
            begin_instant=said.stub("begin", kept=(1, 2)),
        )
        assert tested.cross_with_map(Model(), self.run(), 1, 3, memory()) == 7.0
        assert said.calls == [("saltation", 1, T), ("instant", 2), ("begin", 2, 3)]

    @pytest.mark.parametrize(
        ("fired", "known", "calls"),
        [
            (1, 0, [("saltation", 1, T, [5.0, 6.0]), ("instant", 2), ("keep", 2)]),
            (1, 1, []),
            (0, 1, []),
            (NO_TRANSITION, 1, [("start", 2, 3)]),
        ],
    )
    def test_the_matrix_of_the_jump_that_began_the_instant(self, fired, known, calls):
        said = Recorder()

        def saltation(model, transition, t, x_minus, x_plus, work):
            said.calls.append(("saltation", transition, t, x_minus.tolist()))

        tested = plain(
            jump,
            saltation=saltation,
            begin_at_start=said.stub("start", kept=(1, 2)),
            change_of_instant=said.stub("instant", kept=(1,)),
            keep_map=said.stub("keep", kept=(1,)),
        )
        run = self.run(last_fired=fired, map_is_known=known, instant=np.array([5.0, 6.0, 7.0, 8.0]))
        tested.recall_map(Model(), run, 3, memory())
        assert said.calls == calls

    def test_a_change_of_the_mode_in_an_instant(self):
        said, work = Recorder(), memory()
        run = self.run(mode=2)
        plain(jump, follow=said.stub("follow", kept=(1,))).change_mode_of_instant(Model(), run, 0, work)
        assert work.settled == pytest.approx([0.7 + 1.0, -0.6 - 0.21], rel=1e-14)
        assert work.reset_jacobian[:, :2].tolist() == [[1.0, 0.0], [0.0, 1.0]]
        assert said.calls == [("follow", 2)]


class TestJump:
    """Transition 1 fires with the speed 7 in mode 0; a locked jump follows one that was grazing."""

    def jumped(self, *, tangents=0, room=0, locked=0, marker=0, grazes=False, orthonormal=0):
        said = Recorder()
        model = Model()
        model.target, model.marker = np.array([9, 2]), np.array([9, marker])
        run = SimpleNamespace(mode=0, phase=T, y="y", locked=locked, last_kind=GRAZING, due=[5, 5])
        run.ill_conditioned, run.ill_conditioned_growth, run.steep_jumps = 3, 1.0, 5
        run.chattering = 0
        task = SimpleNamespace(tangents=tangents, orthonormal=orthonormal)
        record, work = SimpleNamespace(jump_phase=np.zeros(room)), SimpleNamespace(new="new", saltation="xi")
        tested = plain(
            jump,
            task_of=lambda task: (None, model, None, run, record, work),
            is_steep=said.stub("steep", False),
            is_steep_behind=said.stub("steep behind", False),
            keep_unknown_time=said.stub("time", kept=(3,)),
            recall_map=said.stub("recall", kept=(2,)),
            cross=said.stub("cross", 7.0, kept=(1, 2, 3)),
            follow=said.stub("follow", kept=(1,)),
            cross_with_map=said.stub("with map", 7.0, kept=(2, 3)),
            cross_without_map=said.stub("without", 7.0, kept=(2, 3)),
            is_grazing=said.stub("grazing", grazes, kept=(3, 4)),
            remember_jump=said.stub("record", kept=(3, 4, 5, 6, 7)),
            map_of_instant=said.stub("map", kept=(1, 2)),
            assume_sizes=said.stub("sizes"),
            judge=said.stub("judge", kept=(1,)),
            restore_tangents=said.stub("restore", kept=(1, 2)),
            carry_tangents=said.stub("carry", 0.5, kept=(2, 3, 4)),
            leave=said.stub("leave", kept=(2, 3)),
        )
        tested.jump(task, 1)
        assert (run.last_transversality, run.due, run.locked, run.steep_jumps) == (7.0, [5, 0], 0, 5)
        self.counts = run.last_kind == GRAZING, run.ill_conditioned - 3, run.ill_conditioned_growth - 1.0
        return said.calls

    def test_of_a_run_without_tangent_vectors_and_record(self):
        for locked in (0, 1):
            calls = self.jumped(locked=locked)
            record = ("record", 1, 7.0, TRANSVERSE, False, "new")
            assert calls == [("time", 1), ("without", 1, 0), record, ("leave", 1, 7.0)]
            assert self.counts == (False, 0, 0.0)

    @pytest.mark.parametrize("grazes", [False, True])
    def test_that_is_recorded(self, grazes):
        calls = self.jumped(room=4, grazes=grazes)
        kind = GRAZING if grazes else TRANSVERSE
        assert calls == [
            ("time", 1), ("without", 1, 0), ("grazing", 1, 7.0), ("record", 1, 7.0, kind, False, "new"),
            ("leave", 1, 7.0),
        ]  # fmt: skip
        assert self.counts == (grazes, int(grazes), 0.0)
        # A marker does not graze.
        assert ("grazing", 1, 7.0) not in self.jumped(room=4, grazes=grazes, marker=1)
        assert self.counts == (False, 0, 0.0)

    @pytest.mark.parametrize("grazes", [False, True])
    @pytest.mark.parametrize("orthonormal", [0, 1])
    def test_of_tangent_vectors(self, grazes, orthonormal):
        calls = self.jumped(tangents=1, grazes=grazes, orthonormal=orthonormal)
        kind = GRAZING if grazes else TRANSVERSE
        assert calls == [
            "steep",
            ("time", 1),
            ("with map", 1, 1),
            ("grazing", 1, 7.0),
            ("record", 1, 7.0, kind, True, "new"),
            ("judge", 2),
            ("carry", 1, orthonormal == 1, grazes),
            ("leave", 1, 7.0),
            "steep behind",
        ]
        assert self.counts == (grazes, int(grazes), 0.5 * grazes)

    @pytest.mark.parametrize(("tangents", "room"), [(0, 1), (1, 0), (3, 4)])
    def test_that_is_locked_to_another(self, tangents, room):
        """It inherits that the other one was grazing, and its matrix is that of the instant."""
        calls = self.jumped(tangents=tangents, room=room, locked=1)
        carried = [("judge", 2), ("restore", 2, tangents), ("carry", tangents, False, True)]
        assert calls == [
            ("recall", tangents), ("cross", 1, 0, 2), ("follow", 2), ("record", 1, 7.0, GRAZING, True, "new"),
            ("map", 2, "xi"), "sizes", *(carried if tangents else []), ("leave", 1, 7.0),
        ]  # fmt: skip
        assert self.counts == (True, 1, 0.5 if tangents else 0.0)


def test_images_of_tangent_vectors_have_the_rounding_of_their_terms():
    """A jump multiplies two vectors of three states; each image may be off by the sizes of its own terms."""
    saltation = np.array([[1.0, -2.0, 0.0], [0.0, 3.0, 0.5], [4.0, 0.0, -1.0]])
    sizes = np.array([[1.0, 5.0, 7.0], [2.0, 3.0, 1.0], [4.0, 9.0, 6.0]])
    vectors = np.array([[0.6, 0.0, -0.8], [0.0, -1.0, 0.0]])
    calls = []

    def orthonormalise(y, n, tangents, growth, terms, images, annihilated):
        assert annihilated == 0
        calls.append((y[3:].copy(), terms.copy(), images))
        growth[0] += 10.0 ** len(calls)
        # So many directions are lost.
        return len(calls)

    kernels = plain(jump, orthonormalise=orthonormalise)

    def carried(orthonormal, apart, strain=0.0):
        calls.clear()
        run = SimpleNamespace(
            y=np.array([9.0, 8.0, 7.0, *vectors.ravel()]),
            growth=np.zeros(2),
            log_determinant=1.0,
            strain=strain,
            indistinct=0,
        )
        work = SimpleNamespace(
            saltation=saltation,
            sizes=sizes,
            jacobian=np.zeros((3, 4)),
            reset_jacobian=np.zeros((3, 4)),
            state=np.zeros(3),
            rounding=np.zeros((4, 3)),
        )
        added = kernels.carry_tangents(SimpleNamespace(dimension=3), run, 2, orthonormal, apart, work)
        images = np.array([vectors @ saltation.T])
        np.testing.assert_allclose(run.y[3:], images.ravel(), rtol=1e-15)
        np.testing.assert_array_equal(run.y[:3], [9.0, 8.0, 7.0])
        assert run.log_determinant == pytest.approx(1.0 + np.log(abs(np.linalg.det(saltation))), rel=1e-14)
        assert run.indistinct == sum(range(1, len(calls) + 1))
        return added, run.strain

    # The growth that the second call finds is that of the jump alone.
    assert carried(True, True) == (100.0, 0.0)
    (before, _, first), (after, terms, second) = calls
    assert (first, second) == (False, True)
    np.testing.assert_array_equal(before, vectors.ravel())
    np.testing.assert_allclose(after, (vectors @ saltation.T).ravel(), rtol=1e-15)
    np.testing.assert_allclose(terms[:2, :3], np.abs(vectors) @ sizes.T, rtol=1e-15)
    # Without need, nothing is made orthonormal, and the strain adds up.
    assert carried(False, True)[0] == carried(True, False)[0] == 0.0
    assert not calls
    assert carried(True, False, strain=0.5)[1] - carried(True, False)[1] == pytest.approx(0.5, rel=1e-12)
    assert carried(True, False, strain=1e9) == (100.0, 0.0)


@pytest.mark.parametrize(
    ("phase", "cycle", "here"), [(3.0, 2, 6), (3.0, 1, 1), (2.0, 2, 1)], ids=["same", "period", "time"]
)
def test_a_jump_moves_the_run(phase, cycle, here):
    """Jumps at one instant are counted, and each stay is as long as it was."""
    model = SimpleNamespace(dimension=2)
    run = SimpleNamespace(
        y=np.zeros(2),
        scale=np.array([2.0, 2.0]),
        phase=3.0,
        cycle=2,
        last_jump_phase=phase,
        last_jump_cycle=cycle,
        jumps_here=5,
        recent=np.full(8, 9),
        visits=np.zeros((8, 2)),
        jumps=10,
        last_fired=0,
        stay=np.zeros(3),
        since_entry=0.75,
        previous_mode=0,
        mode=1,
        stage=0,
    )
    plain(jump, remember_visit=lambda model, run: None).move(model, run, 4, 2, np.array([1.0, -3.0]))
    assert (run.y.tolist(), run.scale.tolist()) == ([1.0, -3.0], [2.0, 3.0])
    assert (run.jumps_here, run.last_jump_phase, run.last_jump_cycle) == (here, 3.0, 2)
    assert (run.jumps, run.last_fired, run.recent.tolist()) == (11, 4, [9, 9, 4, 9, 9, 9, 9, 9])
    assert (run.mode, run.previous_mode, run.stage) == (2, 1, ENTERING)
    assert (run.stay.tolist(), run.since_entry) == ([0.0, 0.75, 0.0], 0.0)


@pytest.mark.parametrize(
    ("speed", "acceleration", "last", "grazes"),
    [
        # The depth ``v^2 / 2 a`` of the dip, compared with a band of 1/2.
        (2.0, 4.0, {}, True),
        (2.0, -4.0, {}, True),
        (2.1, 4.0, {}, False),
        (-2.1, 4.0, {}, False),
        # After a grazing by the same transition, on the way back, at most twice as fast.
        (3.0, 1.0, {"way_in": -1.5}, True),
        (-3.0, 1.0, {"way_in": 1.5}, True),
        (3.1, 1.0, {"way_in": -1.5}, False),
        (3.0, 1.0, {"way_in": 1.5}, False),
        (3.0, 1.0, {"way_in": -1.5, "kind": TRANSVERSE}, False),
        (3.0, 1.0, {"way_in": -1.5, "fired": 0}, False),
    ],
)
def test_dips_that_the_tolerances_cannot_tell(speed, acceleration, last, grazes):
    run = SimpleNamespace(
        mode=0,
        phase=0.0,
        y=np.zeros(1),
        last_transversality=last.get("way_in", 9.0),
        last_kind=last.get("kind", GRAZING if last else TRANSVERSE),
        last_fired=last.get("fired", 1),
    )
    model, work = SimpleNamespace(dimension=1), SimpleNamespace(gradient=None)
    for found in (False, True):
        tested = plain(
            jump,
            guard_acceleration=lambda *given: acceleration,
            error_band=lambda *given: 0.5,
            finds_surface=lambda model, transition, t, x, given, work, found=found: found and given == speed,
        )
        # What looks like a dip may be a flat or a jumping guard, whose surface is found.
        hidden = found and not last
        assert tested.is_grazing(model, None, run, 1, speed, work) == (grazes and not hidden)


@pytest.mark.parametrize(
    ("entry", "largest", "singular"), [(-9.0, 9.0, 0), (1.0, 5.0, 0), (np.inf, np.inf, 1)]
)
def test_matrices_that_are_not_finite_are_counted(entry, largest, singular):
    run = SimpleNamespace(largest_saltation=5.0, singular_jumps=0)
    work = SimpleNamespace(saltation=np.array([[0.5, entry], [0.0, 1.0]]))
    plain(jump).judge(run, 2, work)
    assert (run.largest_saltation, run.singular_jumps) == (largest, singular)
