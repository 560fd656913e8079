"""The process that commands on the tiny scene are forked from."""

from collections.abc import Iterator

import pytest

from tests.hunt.command import Server


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    with Server() as one:
        one.warm_up("tests.chamberopt.common.files.scene:remember_all")
        yield one
