"""Every model and its results travel to other processes by pickle."""

import multiprocessing
import pickle

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from models.contact import matched_laws

FACTORIES = [getattr(models, name) for name in models.__all__]
LAWS = [*matched_laws(1.5e11, 90.9, 0.4).values(), *matched_laws(1.5e11, 90.9, 0.4, e=0.8).values()]


@pytest.mark.parametrize("factory", FACTORIES, ids=models.__all__)
def test_a_model_is_the_same_after_pickling(factory):
    system = factory()
    again = pickle.loads(pickle.dumps(system))
    assert repr(again) == repr(system)
    assert pickle.dumps(again) == pickle.dumps(pickle.loads(pickle.dumps(again)))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_a_model_with_any_law_of_contact_can_be_pickled(law):
    assert pickle.loads(pickle.dumps(models.vibroimpact(law))).mode_names[0] == "free"


def results():
    system = models.impact_oscillator()
    return (
        hybrid.simulate(system, (0.0, 0.0), (0.0, 20.0)),
        hybrid.periodic_orbit(system, (0.9, 1.0)),
        lyapunov.lyapunov_spectrum(system, (0.0, 0.0), intervals=5, transient=0),
    )


@pytest.mark.as_given
def test_results_come_back_from_a_new_process():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        arc, orbit, spectrum = pool.apply(results)
    here = results()
    np.testing.assert_array_equal(arc.x, here[0].x)
    np.testing.assert_array_equal(arc(3.0), here[0](3.0))
    np.testing.assert_array_equal(orbit.multipliers, here[1].multipliers)
    np.testing.assert_array_equal(spectrum.exponents, here[2].exponents)
    assert orbit.arc().status.ok
