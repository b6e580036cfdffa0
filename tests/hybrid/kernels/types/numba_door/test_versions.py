"""The versions of numba and llvmlite with which the private parts of them that are used have been tested."""

import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[5]
# All tests have passed with these. After a change here, change the caps in pyproject.toml.
TESTED = {"llvmlite": "0.50.0", "numba": "0.68.1"}


def minor(release):
    return tuple(map(int, release.split(".")[:2]))


@pytest.mark.parametrize("package", TESTED)
def test_pyproject_allows_the_minor_release_that_was_tested_and_no_other(package):
    major, tested = minor(TESTED[package])
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = tomllib.load(file)["project"]["dependencies"]
    assert f"{package}>={major}.{tested},<{major}.{tested + 1}" in listed


@pytest.mark.parametrize("package", TESTED)
def test_these_tests_run_with_a_release_that_was_tested(package):
    assert minor(version(package)) == minor(TESTED[package])
