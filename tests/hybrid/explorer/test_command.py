"""``python -m hybrid explore``: models are found, and what is wrong is said."""

import numpy as np
import pytest

import hybrid
import models
from hybrid.__main__ import main
from hybrid.errors import ArgumentError
from hybrid.explorer.command import model_of

OWN = """
import models

system = models.bouncing_ball()


def make():
    return system


def needs(e):
    return system


number = 3
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own_model.py"
    path.write_text(OWN)
    return path


def test_a_factory_of_a_module():
    system, text = model_of("models:impact_oscillator")
    assert system.state_names == models.impact_oscillator().state_names
    made = {}
    exec(text, made)
    assert made["system"].state_names == system.state_names


@pytest.mark.parametrize("name", ["system", "make"])
def test_a_system_or_factory_of_a_file(own, name):
    system, text = model_of(f"{own}:{name}")
    made = {}
    exec(text, made)
    arcs = [hybrid.simulate(each, (1.0, 0.0), (0.0, 1.0)) for each in (system, made["system"])]
    np.testing.assert_array_equal(arcs[0].x, arcs[1].x)


def test_the_script_names_the_system_once(own):
    """A file that calls its model system needs no second name."""
    _, text = model_of(f"{own}:system")
    assert "system = system" not in text


def test_a_system_of_a_file_is_among_the_names(own):
    with pytest.raises(ArgumentError, match="'system'"):
        model_of(f"{own}:sistem")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("models", "The model must be named as MODULE:MODEL"),
        ("models:vibroimpakt", "Did you mean 'vibroimpact'?"),
        ("no_such_module:system", "Module 'no_such_module' was not found"),
        ("no_such_file.py:system", "File 'no_such_file.py' was not found"),
    ],
)
def test_a_wrong_name_is_said(given, said):
    with pytest.raises(ArgumentError) as raised:
        model_of(given)
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [("number", "must be a HybridSystem or a factory"), ("needs", "does not run without arguments")],
)
def test_what_is_no_model_is_said(own, name, said):
    with pytest.raises(ArgumentError) as raised:
        model_of(f"{own}:{name}")
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--set", "w"], "--set takes NAME=VALUE; got 'w'."),
        (["--set", "w=fast"], "--set w must be a number; got 'fast'."),
        (["--start", "z=1"], "--start: component 'z' does not exist. State components: x, v."),
        (["--range", "w=1"], "--range w must be a number"),
        (["--port", "70000"], "port must be a whole number from 0 to 65535"),
    ],
)
def test_wrong_options_end_with_a_word(options, said, capsys):
    assert main(["explore", "models:impact_oscillator", "--no-browser", *options]) == 1
    assert said in capsys.readouterr().err
