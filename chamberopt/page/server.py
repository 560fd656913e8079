"""Serve the web page that makes and edits a design, to the person who started the server alone."""

from __future__ import annotations

import hmac
import json
import secrets
import socket
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from urllib.parse import parse_qs

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import (
    FileResponse,
    JSONResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
)
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from chamberopt.common.errors import InputError
from chamberopt.page.checker import SupersededError
from chamberopt.page.front import Front
from chamberopt.page.page_words import at_keys, on_page
from chamberopt.printers.report_page import POLICY
from sim_core import SceneError

# One person's browser on this machine may talk to the server, and no other page in that browser.
#
# The server listens on the loopback address only. The printed address holds a token, which becomes
# a cookie that scripts cannot read and other sites cannot send. The host's name is checked against
# rebinding of DNS, and the origin of each request that changes anything. See OWASP, "Cross-Site
# Request Forgery Prevention" and "DNS rebinding".

EDITOR_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: "
    "blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
UNKNOWN = "open the address that chamberopt edit printed, with its token"
# Browsers send cookies to every port of a host, so another server on this machine could learn the
# cookie. A request that asks or changes anything also takes a key, which only the page keeps.
KEY, OPEN = "x-chamberopt-key", ("/browser/", "/files/")
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class OnePerson:
    """Wraps the server's application, and refuses requests of all but the person who started it."""

    def __init__(self, app: ASGIApp, port: int) -> None:
        self._app, self._cookie = app, f"chamberopt-{port}"
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._origins = {f"http://{host}" for host in self._hosts}
        self.token, self._key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        response = self._refusal(Request(scope))
        if response is not None:
            await response(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                named = {key for key, _ in message["headers"]}
                added = {**HEADERS, "Content-Security-Policy": EDITOR_POLICY}
                message["headers"] += [
                    (key.lower().encode(), value.encode())
                    for key, value in added.items()
                    if key.lower().encode() not in named
                ]
            await send(message)

        await self._app(scope, receive, send_with_headers)

    def _refusal(self, request: Request) -> Response | None:
        """Return None if a request may be served, otherwise the response to give instead.

        The response is a refusal. If the request opens the page with the secret token in its
        address, the response sets the cookie that later requests carry.
        """
        if request.headers.get("host") not in self._hosts:
            return _refused("this server is for this machine only")
        origin = request.headers.get("origin")
        if origin is not None and origin not in self._origins:
            return _refused("another page may not use this one")
        if request.method not in ("GET", "HEAD") and origin is None:
            return _refused("only the page itself may change anything")
        given = parse_qs(request.url.query).get("token", [""])[0]
        if request.url.path == "/" and given and self._is_token(given):
            response = RedirectResponse(f"/#{self._key}", 303, HEADERS)
            response.set_cookie(self._cookie, self.token, httponly=True, samesite="strict")
            return response
        if not self._is_token(request.cookies.get(self._cookie, "")):
            return _refused(UNKNOWN)
        is_open = request.url.path == "/" or request.url.path.startswith(OPEN)
        if not is_open and not _same(request.headers.get(KEY, ""), self._key):
            return _refused(UNKNOWN)
        return None

    def _is_token(self, given: str) -> bool:
        return _same(given, self.token)


def _same(given: str, wanted: str) -> bool:
    return hmac.compare_digest(given.encode(), wanted.encode())


def _refused(why: str) -> Response:
    return PlainTextResponse(f"refused: {why}\n", 403, HEADERS)


BROWSER = Path(__file__).parent / "browser"
# A report runs scripts of its own. In the sandbox it has no origin, and cannot use this server.
FILE_POLICY = "sandbox allow-scripts allow-modals allow-popups allow-downloads"
SHOWN_FILES = {".html": "text/html", ".pdf": "application/pdf", ".png": "image/png"}
# Names of requests to the front page and to that of a design; looks take no question, by GET.
OF_FRONT = (
    "example",
    "look",
    "view",
    "face",
    "surfaces",
    "chamber",
    "propose",
    "open",
    "close",
    "stop",
)
LOOKS_OF_FRONT = "front", "status"
OF_DESIGN = (
    "read", "part", "surface", "fields", "structure", "step", "remove", "shape", "cavity", "reach",
    "faces", "names", "pick", "picked", "save", "study", "start", "make", "made", "shown",
    "candidates", "candidate", "model", "resume", "more", "duration", "tried", "results",
    "difference",
)  # fmt: skip
CLOSED = "no design is open here any more: reload the page"
NONSENSE = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    RecursionError,
    OSError,
)
MOST_BYTES, MOST_OF_PART = 2_000_000, 500_000_000  # bytes of a question, and of a part's file
TOO_LONG = f"this question has more than {1e-6 * MOST_BYTES:g} MB; ask for less at a time"
TOO_LARGE = f"this file has more than {1e-6 * MOST_OF_PART:g} MB; give a coarser mesh"


def make_app(front: Front, port: int) -> OnePerson:
    """Return the server's web application.

    It has addresses for each request that the front page and the page of a design can make, for
    the pages, and for their files.
    """

    async def answered(
        request: Request, act: Callable[[bytes], object], most: int, too_long: str
    ) -> Response:
        try:
            body = await _body(request, most) if request.method == "POST" else b""
            if body is None:
                return JSONResponse({"error": too_long}, 413, {"Connection": "close"})
            found = await run_in_threadpool(act, body)
        except ClientDisconnect:  # nobody waits for an answer
            return Response(status_code=400)
        except SupersededError:
            return JSONResponse({"superseded": True})
        except (InputError, SceneError) as error:
            text = str(error)
            return JSONResponse({"error": text, "words": on_page(text), "at": at_keys(text)})
        except NONSENSE as error:
            return JSONResponse({"error": f"not a question of this page: {error!r}"}, 400)
        if isinstance(found, bytes):
            return Response(found, media_type="application/octet-stream")
        return JSONResponse(found)

    def route(name: str, method: str, of_design: bool) -> Route:
        def act(body: bytes) -> object:
            page = front.acts if of_design else front
            if page is None:
                raise InputError(CLOSED)
            return getattr(page, name)(json.loads(body or b"{}"))

        async def answer(request: Request) -> Response:
            return await answered(request, act, MOST_BYTES, TOO_LONG)

        return Route(f"/{name}", answer, methods=[method])

    async def upload(request: Request) -> Response:
        name = request.query_params.get("name", "")
        act = partial(front.upload, name)
        return await answered(request, act, MOST_OF_PART, TOO_LARGE)

    async def page(_: Request) -> Response:
        return FileResponse(BROWSER / ("index.html" if front.acts else "front.html"))

    async def file(request: Request) -> Response:
        try:
            path = front.inside(request.path_params["name"])
            kind = SHOWN_FILES.get(path.suffix) if path.is_file() else None
        except (InputError, *NONSENSE) as error:
            return JSONResponse({"error": str(error)}, 404)
        if kind is None:
            return JSONResponse({"error": "no report, sheet or picture"}, 404)
        policy = f"{POLICY}; {FILE_POLICY}" if kind == "text/html" else FILE_POLICY
        return FileResponse(path, media_type=kind, headers={"Content-Security-Policy": policy})

    routes = [
        Route("/", page),
        Route("/upload", upload, methods=["POST"]),
        *(route(name, "POST", False) for name in OF_FRONT),
        *(route(name, "GET", False) for name in LOOKS_OF_FRONT),
        *(route(name, "POST", True) for name in OF_DESIGN),
        Route("/files/{name:path}", file),
        Mount("/browser", StaticFiles(directory=BROWSER)),
    ]
    return OnePerson(Starlette(routes=routes), port)


async def _body(request: Request, most: int) -> bytes | None:
    """Return the body of a request, or None if it has, or says that it has, more bytes."""
    if int(request.headers.get("content-length", 0)) > most:
        return None
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > most:
            return None
    return bytes(body)


def serve(
    folder: Path, file: Path | None, port: int, trusted: bool, tell: Callable[[str], None]
) -> None:
    """Serve the page of a design, or the front page of a folder, until Ctrl-C.

    Args:
        folder: folder of the front page.
        file: the design, or a part with which the front page begins; None for neither.
        port: number of the port; 0 for any free port.
        trusted: whether the chamber's shape in a design may be a Python file, which is then run.
        tell: called with the page's address when the server answers there.

    Raises:
        InputError: the design cannot be edited, or the port cannot be used.
    """
    front = Front(folder, file, trusted)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if sys.platform != "win32":  # takes a port just left; Windows would share a port in use
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        try:
            listening.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or "not from 0 to 65535"
            raise InputError(f"--port: {port}: {why}; give another, or none") from None
        listening.listen()
        port = listening.getsockname()[1]
        app = make_app(front, port)
        tell(f"http://127.0.0.1:{port}/?token={app.token}")
        uvicorn.Server(uvicorn.Config(app, log_level="warning", lifespan="off")).run([listening])
    finally:
        front.end()
        listening.close()
