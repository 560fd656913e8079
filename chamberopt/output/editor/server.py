"""The page's server: what is at each of its addresses, on this machine only."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

import chamberopt.output.report as report
from chamberopt.common.errors import InputError
from chamberopt.output.editor.acts import Acts
from chamberopt.output.editor.checker import SupersededError
from chamberopt.output.editor.security import OnePerson
from chamberopt.output.report.page import POLICY
from sim_core import SceneError

OWN, SHARED = Path(__file__).parent / "browser", Path(report.__file__).parent / "browser"
# A report runs scripts of its own: it is shown as a page of nobody, which cannot use this server.
FILE_POLICY = "sandbox allow-scripts allow-modals allow-popups allow-downloads"
SHOWN_FILES = {".html": "text/html", ".pdf": "application/pdf", ".png": "image/png"}
# Names of acts; those that need no question are asked by GET.
QUESTIONS = ("read", "part", "shape", "cavity", "reach", "pick")
ACTS = ("save", "study", "start", "stop", "shown")
LOOKS = "status", "results"
NONSENSE = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    RecursionError,
    OSError,
)
MOST_BYTES = 2_000_000  # of a question
TOO_LONG = f"this question has more than {1e-6 * MOST_BYTES:g} MB; ask for less at a time"


def make_app(acts: Acts, port: int) -> OnePerson:
    """The server's application."""

    def route(name: str, method: str) -> Route:
        act = getattr(acts, name)

        async def answer(request: Request) -> Response:
            try:
                body = await _body(request) if method == "POST" else b"{}"
                if body is None:
                    return JSONResponse({"error": TOO_LONG}, 413, {"Connection": "close"})
                found = await run_in_threadpool(act, json.loads(body or b"{}"))
            except ClientDisconnect:  # nobody waits for an answer
                return Response(status_code=400)
            except SupersededError:
                return JSONResponse({"superseded": True})
            except (InputError, SceneError) as error:
                return JSONResponse({"error": str(error)})
            except NONSENSE as error:
                return JSONResponse({"error": f"not a question of this page: {error!r}"}, 400)
            if isinstance(found, bytes):
                return Response(found, media_type="application/octet-stream")
            return JSONResponse(found)

        return Route(f"/{name}", answer, methods=[method])

    async def page(_: Request) -> Response:
        return FileResponse(OWN / "index.html")

    async def file(request: Request) -> Response:
        try:
            path = acts.inside(request.path_params["name"])
            kind = SHOWN_FILES.get(path.suffix) if path.is_file() else None
        except (InputError, *NONSENSE) as error:
            return JSONResponse({"error": str(error)}, 404)
        if kind is None:
            return JSONResponse({"error": "no report, sheet or picture"}, 404)
        policy = f"{POLICY}; {FILE_POLICY}" if kind == "text/html" else FILE_POLICY
        return FileResponse(path, media_type=kind, headers={"Content-Security-Policy": policy})

    routes = [
        Route("/", page),
        *(route(name, "POST") for name in (*QUESTIONS, *ACTS)),
        *(route(name, "GET") for name in LOOKS),
        Route("/files/{name:path}", file),
        Mount("/shared", StaticFiles(directory=SHARED)),
        Mount("/own", StaticFiles(directory=OWN)),
    ]
    return OnePerson(Starlette(routes=routes), port)


async def _body(request: Request) -> bytes | None:
    """The body of a request; None as soon as it is, or says that it will be, too long."""
    if int(request.headers.get("content-length", 0)) > MOST_BYTES:
        return None
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > MOST_BYTES:
            return None
    return bytes(body)


def serve(path: Path, port: int, trusted: bool, tell: Callable[[str], None]) -> None:
    """Serve the page of a design until Ctrl-C.

    Args:
        trusted: whether designs may have a Python file as their shape.
        port: of the loopback address; 0 for a free one.
        tell: called with the address once the server answers there.
    """
    acts = Acts(path, trusted)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if os.name == "posix":  # a port that was just left; elsewhere this shares one that is in use
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        try:
            listening.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or "not from 0 to 65535"
            raise InputError(f"--port: {port}: {why}; give another, or none") from None
        listening.listen()
        port = listening.getsockname()[1]
        app = make_app(acts, port)
        tell(f"http://127.0.0.1:{port}/?token={app.token}")
        uvicorn.Server(uvicorn.Config(app, log_level="warning", lifespan="off")).run([listening])
    finally:
        acts.close()
        listening.close()
