"""Fixtures of tests of attractors."""

import signal

import pytest


@pytest.fixture
def python_hears_interrupts():
    """A process that runs tests for another one may ignore them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
