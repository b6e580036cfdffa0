"""Guards that are the same function up to a factor share a surface, and the sign of the factor is known."""

import hybrid
from hybrid.compiler.surfaces import is_paired, surfaces
from hybrid.expression.nodes import Symbol, number

q, v, e = map(Symbol, ("q", "v", "e"))


def test_a_factor_is_divided_out_with_its_sign():
    found, signs = surfaces([print] * 5, [2 * q - v, v / 3 - 2 * q / 3, q + v, -5 * q - 5 * v, e * q], {})
    assert found == (0, 0, 1, 1, 2)
    assert signs[0] == -signs[1]
    assert signs[2] == -signs[3]


def test_constants_and_untraced_functions():
    def one():
        """Not traced."""

    def other():
        """Not traced either."""

    found, signs = surfaces([one, other, one, one, one], [None, None, None, number(2), number(2)], {})
    assert found == (0, 1, 0, 2, 3)
    assert signs == (1, 1, 1, 1, 1)


def test_a_transition_back_across_the_same_surface_is_paired():
    system = hybrid.HybridSystem(
        state=("q",),
        modes=[hybrid.Mode("a", lambda t, x, p: (1.0,)), hybrid.Mode("b", lambda t, x, p: (-1.0,))],
        transitions=[
            hybrid.Transition("a", "b", hybrid.Guard(lambda t, x, p: x.q - 1, +1), name="out"),
            hybrid.Transition("b", "a", hybrid.Guard(lambda t, x, p: 3 - 3 * x.q, +1), name="back"),
        ],
    )
    emitted = hybrid.compile_system(system).emitted
    assert emitted.surface == (0, 0)
    assert emitted.orientation[0] == -emitted.orientation[1]


def test_pairs_are_two_directions_across_one_surface_of_one_mode():
    def transition(name, source, guard, direction):
        return hybrid.Transition(source, "b", hybrid.Guard(guard, direction), name=name)

    system = hybrid.HybridSystem(
        state=("q",),
        modes=[hybrid.Mode("a", lambda t, x, p: (1.0,)), hybrid.Mode("b", lambda t, x, p: (-1.0,))],
        transitions=[
            transition("up", "a", lambda t, x, p: x.q - 1, +1),
            transition("down", "a", lambda t, x, p: 3 - 3 * x.q, +1),
            transition("once", "a", lambda t, x, p: x.q - 5, +1),
            transition("again", "a", lambda t, x, p: 2 * x.q - 10, +1),
            transition("elsewhere", "b", lambda t, x, p: x.q - 5, -1),
        ],
    )
    emitted = hybrid.compile_system(system).emitted
    assert [is_paired(system, emitted, i) for i in range(5)] == [True, True, False, False, False]
