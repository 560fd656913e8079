"""Who may talk to the page's server: one person's browser on this machine, and no other page in it.

The server listens on the loopback address only. The printed address holds a token, which becomes a
cookie that scripts cannot read and other sites cannot send; the names of hosts are checked against
rebinding of DNS, and the origin of what changes anything. See OWASP, "Cross-Site Request Forgery
Prevention" and "DNS rebinding".
"""

from __future__ import annotations

import hmac
import secrets
from urllib.parse import parse_qs

from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: "
    "blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
UNKNOWN = "open the address that chamberopt edit printed, with its token"
# Browsers send cookies to every port of a host, so that another server on this machine could learn
# the cookie. What asks or changes anything takes a key too, which the page alone keeps.
KEY, OPEN = "x-chamberopt-key", ("/own/", "/shared/", "/files/")
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}


class OnePerson:
    """Refuse every request that does not come from the person who started the server."""

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
                added = {**HEADERS, "Content-Security-Policy": POLICY}
                message["headers"] += [
                    (key.lower().encode(), value.encode())
                    for key, value in added.items()
                    if key.lower().encode() not in named
                ]
            await send(message)

        await self._app(scope, receive, send_with_headers)

    def _refusal(self, request: Request) -> Response | None:
        """Why a request is not served, or how a browser that knows the token gets its cookie."""
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
