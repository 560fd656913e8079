"""The examples in docstrings of the public names run and give what they show."""

import doctest
from types import ModuleType

import pytest

import sim_core
from sim_core.effects import restitution
from sim_core.scene import packing, physics

PUBLIC = {name: getattr(sim_core, name) for name in sim_core.__all__}


@pytest.mark.parametrize("module", [sim_core, restitution, packing, physics])
def test_examples_run(module: ModuleType) -> None:
    found = doctest.testmod(module, extraglobs=PUBLIC)
    assert found.attempted
    assert not found.failed
