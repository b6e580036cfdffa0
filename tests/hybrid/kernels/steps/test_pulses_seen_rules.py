"""Pulses on a step of whose nodes the method has seen other states than those of the interpolant."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps.pulses import Samples
from tests.hybrid.kernels.steps.test_pulses import ALONG, CALM, START, kernels, memory


class TestSeen:
    """A method that has seen other states at the nodes than those of the path."""

    H, NODES = 2.0, np.array([0.0, 0.5, 1.0])

    def hidden(self, seen, along, *, of_stages=(), seen_at_nodes=True):
        """The path is worth ``along`` at its nodes, and nothing between them, apart from a slope."""
        places = np.array(
            [*([value, share] for value, share in zip(seen, self.NODES, strict=True)), *of_stages]
        )
        asked = []

        def bound(programs, program, path, middle, radius, registers):
            if path.powers is ALONG.powers:
                assert path[:5] == ALONG[:5]
                value = along(middle)
                least, most = sorted((along(middle - radius), along(middle + radius)))
                row = (min(least, value), max(most, value), -1.0, 1.0, value, value)
            else:
                assert (path.degree, path.clock, path.pace, middle, radius) == (0, -1, 1.0, 0.0, 0.0)
                assert path.powers.shape == (1, 2)
                asked.append(path.start - START)
                row = (*[path.powers[0, 0]] * 2, 0.0, 0.0, *[path.powers[0, 0]] * 2)
            registers[0], registers[1], registers[2] = CALM, CALM, row
            return 2

        programs = SimpleNamespace(first=np.array([0, 2, 5]), checked=np.array([1, 1, 0, 1, 1]))
        model = SimpleNamespace(programs=programs, bound=bound, dimension=1)
        work = memory(len(self.NODES))
        work.places = places
        demand = kernels.demand_on(self.H, 0.0, 1e-9, True)
        path, at = ALONG._replace(length=self.H), Samples(self.NODES, seen_at_nodes)
        found = kernels.first_hidden(model, 1, path, at, demand, work)
        return found, asked

    def test_a_pulse_at_a_node_that_the_method_has_not_seen_is_hidden(self):
        pulse = lambda s: max(0.0, 1.0 - 20.0 * abs(s - 1.0))  # noqa: E731
        found, asked = self.hidden((0.0, 0.0, 0.0), pulse)
        assert asked == [0.0, 1.0, 2.0]
        # Between the first two nodes, or at most a width of the pulse before the second one.
        assert 0.9 < found[1] <= 1.0

    def test_one_that_it_has_seen_is_not(self):
        pulse = lambda s: max(0.0, 1.0 - 20.0 * abs(s - 1.0))  # noqa: E731
        assert self.hidden((0.0, 1.0, 0.0), pulse)[0] == (2.0, 2.0, 0.0)
        assert self.hidden((0.0, 0.0, 0.0), pulse, seen_at_nodes=False) == ((2.0, 2.0, 0.0), [])

    def test_a_pulse_at_a_stage_of_the_interpolant_is_hidden(self):
        """The interpolant itself, bent by it, shows none."""
        flat = lambda s: 1e-3 * abs(s - 0.7)  # noqa: E731
        for share, before in ((0.4, 0.0), (0.5, 0.0), (0.7, 1.0)):
            found, asked = self.hidden((7e-4, 3e-4, 1.3e-3), flat, of_stages=[[1.0, share]])
            assert asked == pytest.approx([0.0, 1.0, 2.0, 2.0 * share])
            assert found == (before, 2.0 * share, 0.0)

    def test_a_calm_stage_of_the_interpolant_is_not(self):
        flat = lambda s: 1e-3 * abs(s - 0.7)  # noqa: E731
        for value in (-2.5e-4, 1.2e-3):
            assert self.hidden((7e-4, 3e-4, 1.3e-3), flat, of_stages=[[value, 0.4]])[0] == (2.0, 2.0, 0.0)
