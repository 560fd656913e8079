"""The process that commands of the hunt are forked from."""

from collections.abc import Iterator

import pytest

from tests.hunt.command import Server


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server() as one:
        yield one
