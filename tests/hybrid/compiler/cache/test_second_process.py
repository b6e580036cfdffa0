"""Kernels that a second process compiles at the same time."""

import os
import subprocess

import pytest

from hybrid.compiler.cache import second_process
from hybrid.compiler.cache.loader import IN_ANOTHER_PROCESS


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(second_process, "processors", lambda: 2)
    return tmp_path


@pytest.fixture
def refuse(monkeypatch):
    def popen(*arguments, **options):
        raise AssertionError("a process was started")

    monkeypatch.setattr(subprocess, "Popen", popen)


def test_second_process_fills_the_same_cache(empty_cache):
    second_process.start(IN_ANOTHER_PROCESS, ["hybrid.kernels.steps.step"])
    second_process.wait_for(lambda: False)
    [folder] = empty_cache.glob("kernels-*")
    assert [path.name for path in folder.iterdir()] == ["hybrid.kernels.steps.step.o"]
    assert not second_process._helpers


def test_what_becomes_of_it_does_not_matter(empty_cache):
    second_process.start(IN_ANOTHER_PROCESS, ["hybrid.kernels.no_such_module"])
    second_process.wait_for(lambda: False)
    assert list(empty_cache.rglob("*.o")) == []


def test_nor_whether_it_can_be_started(empty_cache, monkeypatch):
    monkeypatch.setattr("sys.executable", str(empty_cache / "no_such_interpreter"))
    second_process.start(IN_ANOTHER_PROCESS, ["hybrid.kernels.steps.step"])
    second_process.wait_for(lambda: False)


def test_one_processor_is_left_to_this_process(empty_cache, monkeypatch, refuse):
    monkeypatch.setattr(second_process, "processors", lambda: 1)
    second_process.start(IN_ANOTHER_PROCESS, ["hybrid.kernels.steps.step"])


def test_nothing_to_compile_starts_nothing(empty_cache, refuse):
    second_process.start(IN_ANOTHER_PROCESS, [])


def test_neither_does_a_program_that_is_its_own_interpreter(empty_cache, monkeypatch, refuse):
    monkeypatch.setattr("sys.frozen", True, raising=False)
    second_process.start(IN_ANOTHER_PROCESS, ["hybrid.kernels.steps.step"])


def test_there_is_nothing_to_wait_for_without_a_start():
    second_process.wait_for(lambda: False)


def test_processors_are_those_of_the_process(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5, 8}, raising=False)
    assert second_process.processors() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    for count, found in ((6, 6), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert second_process.processors() == found
