"""Unreferenced systems are freed, with everything that was made for them."""

import gc
import weakref

import numpy as np

import hybrid
import lyapunov
import models
from hybrid.compiler.llvm.functions import shared_functions
from hybrid.simulation import memory, plan
from hybrid.testing import variants


def test_systems_go_when_nobody_holds_them():
    held = []
    for i in range(40):
        system = models.bouncing_ball()
        arc = hybrid.simulate(system, (1.0, 0.0), (0.0, 1.0), tangent=i % 2 == 0, parameters={"e": 0.5})
        held += [weakref.ref(system), weakref.ref(hybrid.compile_system(system)), weakref.ref(arc)]
    del system, arc
    gc.collect()
    assert [each() for each in held if each() is not None] == []


def test_so_do_those_that_other_calls_made():
    systems = []
    for _ in range(3):
        system = models.impact_oscillator()
        lyapunov.lyapunov_spectrum(system, (0.0, 0.0), intervals=3)
        hybrid.poincare_section(system, (0.0, 0.0), hybrid.Guard(lambda t, x, p: x.v, -1), points=1)
        orbit = hybrid.periodic_orbit(system, (0.9, 1.0))
        _ = system.graph, orbit.arc().jumps.saltation, variants.renamed(system), variants.altered(system)
        systems.append(weakref.ref(system))
    del system, orbit, _
    gc.collect()
    assert [each() for each in systems] == [None] * 3


def test_tolerances_do_not_pile_up():
    system = models.bouncing_ball()
    for rtol in np.geomspace(1e-12, 1e-3, 3 * memory.MOST_LAYOUTS):
        hybrid.simulate(system, (1.0, 0.0), (0.0, 0.1), solver=hybrid.DOP853(rtol=rtol))
    assert len(hybrid.compile_system(system).plans) <= memory.MOST_LAYOUTS
    for cached in (plan.kernel_method, memory.work_layout, memory.record_layout, shared_functions):
        found = cached.cache_info()
        assert found.maxsize is not None
        assert found.currsize <= found.maxsize


def test_the_record_of_a_long_run_goes_with_its_arc():
    """An arc keeps a record that is more than half full; no memory of this run or of one before holds it."""
    systems = [models.vibroimpact() for _ in range(2)]
    for system, periods in zip(systems, (1, 150), strict=True):
        span = 0.0, periods * system.forcing_period()
        arc = hybrid.simulate(system, (0.0, 0.0, 0.0, 0.0), span, mode="free")
    owner = arc._pieces.blocks[0]
    while owner.base is not None:
        owner = owner.base
    held = weakref.ref(owner)
    del arc, owner
    gc.collect()
    assert held() is None
