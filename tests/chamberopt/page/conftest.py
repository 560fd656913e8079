"""The program's page, served to the tests as a user starts it."""

import http.client
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.hunt.base import write_base

pytest.importorskip("uvicorn", reason="extra `page` is not installed")


class Served:
    """A page of a design or folder, and questions to its server as its browser asks them."""

    def __init__(self, folder: Path, *file: str) -> None:
        write_base(folder)
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "chamberopt", "edit", *file],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        first = self.process.stdout.readline()
        assert " is at " in first, self.process.communicate()
        self.address = first.split(" is at ")[1].strip()
        self.host = urlsplit(self.address).netloc
        answer = self.get(self.address.removeprefix(f"http://{self.host}"), cookie="")
        self.cookie = answer.getheader("set-cookie", "").split(";")[0]
        self.key = answer.getheader("location", "").partition("#")[2]
        if file and file[0].endswith(".toml"):
            self.read = self.ask("/read", {})["read"]

    def get(self, path: str, **headers: str) -> http.client.HTTPResponse:
        return self._send("GET", path, None, headers)

    def ask(self, path: str, question: dict[str, Any], **headers: str) -> Any:
        """The answer as JSON, or as bytes."""
        asked = json.dumps({"read": getattr(self, "read", ""), **question})
        answer = self._send("POST", path, asked, {"origin": self.origin, **headers})
        content = answer.read()
        assert answer.status == 200, content
        is_json = answer.getheader("content-type") == "application/json"
        return json.loads(content) if is_json else content

    @property
    def origin(self) -> str:
        return f"http://{self.host}"

    def _send(
        self, method: str, path: str, body: str | bytes | None, headers: dict[str, str]
    ) -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection(self.host, timeout=60)
        own = {"cookie": getattr(self, "cookie", ""), "x-chamberopt-key": getattr(self, "key", "")}
        sent = {"host": self.host, **own, **headers}
        connection.request(method, path, body, {key: text for key, text in sent.items() if text})
        return connection.getresponse()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    page = Served(tmp_path_factory.mktemp("edited"), "design.toml")
    yield page
    page.process.kill()
    page.process.communicate()
