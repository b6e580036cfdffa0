"""What tests of plots share."""

import matplotlib.pyplot as plt
import pytest

import models
from hybrid import simulate


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def bounces():
    return simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
