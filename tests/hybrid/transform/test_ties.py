"""Which surfaces are tied to the surface of their speed."""

import numpy as np
import pytest

from hybrid.expression.surfaces import Surfaces
from hybrid.expression.tracing import model_symbols, trace
from hybrid.system.variables import Variables
from hybrid.transform.cells import Pieces

# Sides of the surfaces in the order in which they are found: the position, then the velocity.
MEETING = {0: 0, 1: 0}


def pieces_of(field, state=("q", "v"), parameters=None):
    variables = Variables(state, parameters or {})
    surfaces = Surfaces(model_symbols(variables.dimension, len(variables.parameters)))
    traced = trace(field, variables.components, variables.parameter_names)
    pieces = Pieces(0, traced, [], variables, surfaces)
    # Surfaces get their numbers as cells are made.
    assert [*pieces.cells({})]
    return pieces


@pytest.mark.parametrize(("factor", "sign"), [(1.0, 1), (-3.0, -1)])
def test_a_position_is_tied_to_its_velocity(factor, sign):
    pieces = pieces_of(lambda t, x, p: (factor * x.v, -2.0 * np.sign(x.q) - np.sign(x.v)))
    assert pieces.ties.at(MEETING) == {0: (1, sign)}
    assert pieces.ties.free(MEETING) == [1]
    assert pieces.ties.moved(MEETING, {1: 2}) == {0: 2 * sign, 1: 2}
    assert [*pieces.ties.vertices(MEETING)] == [{0: -2 * sign, 1: -2}, {0: 2 * sign, 1: 2}]


@pytest.mark.parametrize("mass", [2.0, -2.0])
def test_the_sign_of_a_factor_is_that_for_the_default_parameters(mass):
    pieces = pieces_of(
        lambda t, x, p: (x.v / p.m, -2.0 * np.sign(x.q) - np.sign(x.v)), parameters={"m": mass}
    )
    assert pieces.ties.at(MEETING) == {0: (1, np.sign(mass))}


def test_surfaces_along_which_a_state_slides_on_both_are_not_tied():
    pieces = pieces_of(lambda t, x, p: (-np.sign(x.q) - np.sign(x.v), np.sign(x.q) - np.sign(x.v)))
    assert pieces.ties.at(MEETING) == {}
    assert pieces.ties.free(MEETING) == [0, 1]


def test_a_speed_that_vanishes_elsewhere_too_ties_nothing():
    pieces = pieces_of(lambda t, x, p: (x.v * x.q, -2.0 * np.sign(x.q) - np.sign(x.v)))
    assert pieces.ties.at(MEETING) == {}


def test_a_meeting_without_one_motion_ties_nothing():
    pieces = pieces_of(
        lambda t, x, p: (x.v, -2.0 * np.sign(x.q) - np.sign(x.v), np.sign(x.q)), state=("q", "v", "y")
    )
    assert pieces.ties.at(MEETING) == {}


def test_a_component_that_is_pushed_in_one_direction_with_the_velocity_leaves_one_motion():
    def field(t, x, p):
        force = -2.0 * np.sign(x.q) - np.sign(x.v)
        return x.v, force, 3.0 * force

    pieces = pieces_of(field, state=("q", "v", "w"))
    assert pieces.ties.at(MEETING) == {0: (1, 1)}
