"""The page's server: whom it answers, what it refuses, and that it says what `check` says."""

import http.client
import json
import select
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.facts import describe
from chamberopt.chamber.propose.text import GOALS, study_of_design
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design
from chamberopt.documents.facts import facts_in_words
from chamberopt.page.edited_file import EditedFile
from chamberopt.page.page_words import TERMS
from chamberopt.page.server import serve
from chamberopt.search.study import load_study
from tests.chamberopt.page.conftest import Served
from tests.hunt.base import write_base


def head(answer: bytes) -> dict[str, Any]:
    length = int.from_bytes(answer[:4], "little")
    return dict(json.loads(answer[4 : 4 + length]))


def test_only_the_one_who_has_the_token_is_served(served: Served) -> None:
    assert served.get("/").status == 200
    for path in (
        "/",
        "/status",
        "/browser/editor.js",
        "/browser/view/view3d.js",
        "/files/design.png",
    ):
        assert served.get(path, cookie="").status == 403
    assert served.get("/?token=guessed", cookie="").status == 403
    assert served.get("/", cookie=served.cookie + "x").status == 403
    assert served.get("/status").status == 200
    for key in ("", "guessed"):  # a cookie alone, which other servers of this machine may see
        headers = {"x-chamberopt-key": key}
        assert served.get("/status", **headers).status == 403
        assert (
            served._send("POST", "/read", "{}", {"origin": served.origin, **headers}).status == 403
        )
    answer = served.get(served.address.removeprefix(served.origin), cookie="")
    assert answer.status == 303
    cookie = answer.getheader("set-cookie", "").lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


def test_other_hosts_and_pages_are_refused(served: Served) -> None:
    port = served.host.rpartition(":")[2]
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1:1", f"[::1]:{port}"):
        assert served.get("/", host=host).status == 403
    for origin in ("http://evil.example", "null", "http://127.0.0.1:1"):
        assert served.get("/", origin=origin).status == 403
    assert served._send("POST", "/save", "{}", {}).status == 403  # no origin


def test_every_answer_forbids_what_is_foreign(served: Served) -> None:
    policy = served.get("/").getheader("content-security-policy", "")
    assert policy.startswith("default-src 'none'; script-src 'self';")
    assert "http" not in policy


@pytest.mark.parametrize(
    "name", ["../secret.png", "%2e%2e/secret.png", "/etc/hosts", "..%2f..%2fetc/passwd", "box.stl"]
)
def test_files_are_those_of_results_below_the_design(served: Served, name: str) -> None:
    (served.folder.parent / "secret.png").write_bytes(b"secret")
    answer = served.get(f"/files/{name}")
    assert answer.status == 404
    assert b"secret" not in answer.read().replace(b"secret.png", b"")


def test_a_report_cannot_use_the_server(served: Served) -> None:
    (served.folder / "report.html").write_text("<script>fetch('/save')</script>")
    answer = served.get("/files/report.html")
    assert answer.status == 200
    assert answer.getheader("content-security-policy", "").endswith("downloads")


@pytest.mark.parametrize(
    ("path", "question", "said"),
    [
        ("/start", {"command": "simulate", "of": "../design.toml"}, "outside the folder"),
        ("/start", {"command": "new", "of": "design.toml"}, "not a command of this page"),
        (
            "/start",
            {"command": "simulate", "of": "design.toml", "effort": "huge"},
            "huge: not an effort of this page: asked, quick, thorough",
        ),
        ("/make", {"paper": "report", "of": "../other"}, "outside the folder"),
        ("/shown", {"folders": ["/etc"]}, "outside the folder"),
        ("/shown", {"folders": ["."]}, "result.json"),
        ("/study", {"name": "../s.toml", "vary": {}, "evaluations": 3}, "give a name"),
        ("/study", {"name": "s.toml", "vary": {}, "evaluations": 3}, "nothing varies"),
        ("/study", {"name": "design.toml", "vary": {}, "evaluations": 3}, "exists"),
        (
            "/study",
            {
                "name": "s.toml",
                "vary": {"chamber.height_mm": [40, 60]},
                "evaluations": 3,
                "aim": "p05_coverage",
            },
            "given [40, 60], but the design starts at 30",
        ),
        (
            "/study",
            {
                "name": "s.toml",
                "vary": {"chamber.height_mm": [20, 60]},
                "evaluations": 3,
                "aim": "p05_coverage",
                "limits": [["mean_coverage", "min", None]],
            },
            "limit of mean coverage of the target: given None; give a number",
        ),
        ("/shape", {"changes": {"shot.mass_g": "much"}}, "shot.mass_g: given 'much'"),
        ("/shape", {"changes": {"no.key": 1}}, "not changed on the page"),
        ("/shape", {"changes": {"chamber.shape": "shape.py"}}, "not changed on the page"),
        ("/cavity", {"changes": {"part.mesh": "/etc/hosts"}}, "not changed on the page"),
        ("/shape", {"changes": {}, "read": "another"}, "reload it"),
        ("/start", {"command": "simulate", "of": "own.toml"}, "runs the Python file"),
        (
            "/study",
            {"name": "-x.toml", "vary": {}, "evaluations": 3},
            "give a name of letters and digits",
        ),
        ("/cavity", {"changes": {"part.offset_mm.0": 100}}, "part.offset_mm"),
        ("/reach", {"number": -5}, None),
        ("/candidates", {"folder": "../other"}, "outside the folder"),
        ("/candidates", {"folder": "/etc"}, "outside the folder"),
        ("/candidates", {"folder": "."}, "no study was begun"),
        ("/candidate", {"folder": ".", "number": 1}, "no study was begun"),
        ("/model", {"folder": "../other"}, "outside the folder"),
        ("/resume", {"folder": "../other"}, "outside the folder"),
        ("/resume", {"folder": "."}, "no study was begun"),
        ("/more", {"folder": ".", "evaluations": 5}, "no study was begun"),
    ],
)
def test_a_wrong_question_is_answered_in_words(
    served: Served, path: str, question: dict[str, Any], said: str | None
) -> None:
    own = (served.folder / "design.toml").read_text().replace('"cylinder"', '"shape.py"')
    (served.folder / "own.toml").write_text(own)
    before = sorted(served.folder.rglob("*"))
    answer = served.ask(path, question)
    assert said in answer["error"] if said else answer["superseded"]
    assert sorted(served.folder.rglob("*")) == before


def test_a_study_is_asked_with_limits_in_the_units_of_the_page(served: Served) -> None:
    limits = [
        ["mean_coverage", "min", 90],
        ["std_coverage", "max", 12.5],
        ["mean_coverage", "max", 99],
    ]
    question = {"name": "limited", "evaluations": 3, "aim": "p05_coverage", "limits": limits}
    varied = {"vary": {"chamber.height_mm": [20, 60]}}
    assert served.ask("/study", question | varied) == {"study": "limited.toml"}
    study = load_study(served.folder / "limited.toml")
    held = {name: (one.min, one.max) for name, one in study.constraints.items()}
    assert held == {"mean_coverage": (0.9, 0.99), "std_coverage": (None, 0.125)}
    files = served.ask("/read", {})["files"]
    (asks,) = [one["asks"] for one in files if one["name"] == "limited.toml"]
    assert sorted((name, side, value) for name, _, side, value in asks["limits"]) == sorted(
        (name, side, value) for name, side, value in limits
    )
    assert served.ask("/duration", {"of": "limited.toml"})["searched"] == ""
    (served.folder / "limited.toml").unlink()


def test_a_report_is_begun_beside_a_command(served: Served) -> None:
    asked = {"command": "simulate", "of": "design.toml", "effort": "quick"}
    started = served.ask("/start", asked)
    assert "--effort=quick --out results/design-quick" in started["command"]
    assert started["exit"] is None
    now = served.ask("/make", {"paper": "sheet", "of": "results/none"})
    assert now["command"] == "chamberopt report ./results/none --sheet"
    while now["exit"] is None:
        time.sleep(0.1)
        now = served.ask("/made", {})
    assert now["exit"] == 2  # there is no such result
    assert "results/none" in "".join(map(str, now["fault"]))
    served.ask("/stop", {})
    while json.loads(served.get("/status").read())["exit"] is None:
        time.sleep(0.1)


@pytest.mark.parametrize(
    ("replicas", "most", "seconds"), [(3, 3, 1.0), (3, 3, 1e-4), (200, 200, 10_000)]
)
def test_a_study_of_any_accuracy_of_the_design_is_valid(
    tmp_path: Path, replicas: int, most: int, seconds: float
) -> None:
    write_base(tmp_path)
    path, study = tmp_path / "design.toml", tmp_path / "study.toml"
    accuracy = {"replicas": replicas, "max_replicas": most, "simulated_time_s": seconds}
    changes = {f"process.accuracy.{key}": one for key, one in accuracy.items()}
    EditedFile(path, False).save(changes)
    vary = {"chamber.height_mm": {"low": 20, "high": 60}}
    for goal in GOALS.values():
        study.write_text(study_of_design(path.name, load_design(path), vary, {}, 3, goal))
        assert load_study(study).objective.name == goal.objective


def test_nonsense_is_refused(served: Served) -> None:
    for body in ("", "{", "[]", '{"changes": 3}', "null", 3000 * "[" + 3000 * "]"):
        answer = served._send("POST", "/shape", body, {"origin": served.origin})
        assert answer.status == 400
        assert b"not a question of this page" in answer.read()


@pytest.mark.parametrize("is_chunked", [True, False])
def test_a_long_question_is_refused_before_it_is_taken(served: Served, is_chunked: bool) -> None:
    part, sent = bytes(100_000), 0
    connection = http.client.HTTPConnection(served.host, timeout=60)
    connection.putrequest("POST", "/shape", skip_host=True)
    for name, text in (("host", served.host), ("origin", served.origin),
                       ("cookie", served.cookie), ("x-chamberopt-key", served.key),
                       ("transfer-encoding" if is_chunked else "content-length",
                        "chunked" if is_chunked else str(100 * len(part)))):  # fmt: skip
        connection.putheader(name, text)
    connection.endheaders()
    with suppress(ConnectionError):  # it is closed in the midst of this
        for _ in range(100):
            connection.send(b"%x\r\n%s\r\n" % (len(part), part) if is_chunked else part)
            sent += len(part)
            if select.select([connection.sock], [], [], 0.02)[0]:
                break
    answer = connection.getresponse()
    assert answer.status == 413
    assert "2 MB" in json.loads(answer.read())["error"]
    assert sent < 4_000_000
    assert served.ask("/read", {})["read"] == served.read


def test_it_says_what_check_says_and_older_questions_are_dropped(served: Served) -> None:
    changes = {"chamber.height_mm": 33}
    first = served.ask("/cavity", {"changes": {}})
    second = served.ask("/cavity", {"changes": changes})
    assert served.ask("/reach", {"number": int.from_bytes(first[:4], "little")})["superseded"]
    reach = head(served.ask("/reach", {"number": int.from_bytes(second[:4], "little")}))
    design = load_design(served.folder / "design.toml").changed(changes)
    facts = describe(design, build_chamber(design))
    assert told(reach) == [(one.subject, one.text) for one in facts_in_words(design, facts)]
    assert list(map(as_said, reach["notes"])) == facts["notes"]
    texts = {one.text for one in facts["warnings"]}
    assert warned(reach) == texts
    quick = head(second[4:])
    assert warned(quick) <= texts
    assert told(quick)
    assert set(told(quick)) <= set(told(reach))


def as_said(words: list[str | list[str]]) -> str:
    """A message with its keys, of which the page has words, and without meanings of terms."""
    return "".join(
        one if isinstance(one, str) else one[0 if one[0] in TERMS else 1] for one in words
    )


def told(answer: dict) -> list[tuple[str, str]]:
    return [(subject, as_said(one)) for subject, facts in answer["facts"] for one in facts]


def warned(answer: dict) -> set[str]:
    return set(map(as_said, [*answer["unpeened"], *answer["warnings"]]))


def test_the_shape_is_that_of_the_design(served: Served) -> None:
    answer = served.ask("/shape", {"changes": {"part.rotate_deg.2": 90, "part.offset_mm.0": 2}})
    found = head(answer)
    np.testing.assert_allclose(found["shift"], [2, 0, 20])
    np.testing.assert_allclose(
        np.reshape(found["rotation"], (3, 3)) @ [1, 0, 0], [0, 1, 0], atol=1e-9
    )
    assert found["shape_mm"][1][2] == pytest.approx(30)


def test_a_design_that_changed_on_disk_is_not_replaced(served: Served) -> None:
    design = served.folder / "design.toml"
    before = design.read_text()
    design.write_text(before.replace("mass_g = 3", "mass_g = 2"))
    assert "changed on disk" in served.ask("/save", {"changes": {"shot.mass_g": 4}})["error"]
    assert "mass_g = 2" in design.read_text()
    served.ask("/read", {})  # another page, which has read it: the first one is still refused
    assert "changed on disk" in served.ask("/save", {"changes": {"shot.mass_g": 4}})["error"]
    design.write_text(before)


def started(folder: Path, *options: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "chamberopt", "edit", "design.toml", *options]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL
    )


def test_a_shape_of_the_users_is_not_run_unasked(tmp_path: Path) -> None:
    write_base(tmp_path)
    (tmp_path / "shape.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w').close()")
    design = tmp_path / "design.toml"
    design.write_text(design.read_text().replace('"cylinder"', '"shape.py"'))
    ended = started(tmp_path)
    assert ended.returncode == 2
    assert "runs the Python file shape.py" in ended.stderr
    assert "--trust-shape" in ended.stderr
    assert not (tmp_path / "run").exists()


def test_what_cannot_be_served_is_one_line(served: Served, tmp_path: Path) -> None:
    write_base(tmp_path)
    ended = started(tmp_path, "--port", served.host.rpartition(":")[2])
    assert ended.returncode == 2
    assert "--port" in ended.stderr
    assert "Traceback" not in ended.stderr


class Listening(Exception):  # noqa: N818
    """Ends a server as soon as it has its port."""


def test_a_port_just_left_is_taken(tmp_path: Path) -> None:
    """The server's end of a connection that it closed first holds the port for a minute."""

    def end(address: str) -> None:
        raise Listening(address)

    with socket.create_server(("127.0.0.1", 0)) as left:
        port = left.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)) as client:
            left.accept()[0].close()
            assert client.recv(1) == b""
    with pytest.raises(Listening, match=f":{port}/"):
        serve(tmp_path, None, port, False, end)
    # Nobody may share it with a server that listens.
    with socket.create_server(("127.0.0.1", port)), pytest.raises(InputError, match="--port: "):
        serve(tmp_path, None, port, False, end)


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_ctrl_c_ends_it_quietly(tmp_path: Path) -> None:
    page = Served(tmp_path, "design.toml")
    names = {"origin": page.origin, "cookie": page.cookie, "x-chamberopt-key": page.key}
    cut_off = http.client.HTTPConnection(page.host, timeout=60)
    cut_off.request("POST", "/shape", headers={**names, "content-length": "1000"})
    cut_off.close()  # a client that goes away in the midst of its question
    assert page.ask("/read", {})["read"] == page.read
    page.process.send_signal(signal.SIGINT)
    out, err = page.process.communicate(timeout=60)
    assert page.process.returncode in (0, 130)
    assert "Traceback" not in out + err
    assert len(err.strip().splitlines()) <= 1
