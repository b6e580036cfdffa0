"""Limits of the figures of the study."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from lyapunov.study.figures import LEAST_HEIGHT, _fit_height


@pytest.mark.parametrize("height", [1e-3, LEAST_HEIGHT, 1.0])
def test_the_late_history_the_papers_points_and_the_truth_are_inside(height):
    late = np.linspace(0.5, 0.5 + 0.5 * height, 990)
    history = np.concatenate([np.full(10, 9.0), late])
    figure, ax = plt.subplots()
    _fit_height(ax, [history], [[0.5 + height, np.nan]], 0.5 + 0.1 * height)
    low, high = ax.get_ylim()
    plt.close(figure)
    assert low < 0.5
    assert 0.5 + height < high < 9.0
    assert low + high == pytest.approx(1.0 + height)
    assert high - low == pytest.approx(max(LEAST_HEIGHT, 1.16 * height))
