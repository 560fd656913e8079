"""The process that commands of the hunt are forked from."""

import os
from collections.abc import Iterator

import pytest

from tests.hunt.command import Server


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    os.environ.setdefault("CHAMBEROPT_READER_S", "8")  # hunts wait for no damaged file to end
    with Server() as one:
        yield one
