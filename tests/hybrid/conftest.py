"""Fixtures that are compiled once for all files of this folder."""

import pytest

from tests.hybrid.systems import BALL_SYSTEM, OSCILLATOR_SYSTEM


@pytest.fixture
def ball():
    return BALL_SYSTEM


@pytest.fixture
def oscillator():
    return OSCILLATOR_SYSTEM
