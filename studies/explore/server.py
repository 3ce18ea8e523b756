"""Serve the explorer's page: on this machine as files and one WebSocket, in a notebook over the notebook's connection.

The server on this machine answers only requests with its token, from its own page.
"""

import asyncio
import hmac
import json
import secrets
import socket
import struct
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from typing import Any

from render.transport import Transport
from rodcone.errors import InputError, require_whole
from rodcone.optional import optional_library
from studies.explore.messages import MOST_CHARACTERS, Header
from studies.explore.session import Session
from studies.explore.source import of_transport
from studies.pages.page import TEMPLATES, own_file

HOST = "127.0.0.1"
FILES = {
    "": ("explore.html", "text/html"),
    "explore.js": ("explore.js", "text/javascript"),
    "explore_page.js": ("explore_page.js", "text/javascript"),
    "explore.css": ("explore.css", "text/css"),
}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
EXTRA = "explore"
# Most messages and characters per second that are read from one connection, so that a hostile page doesn't block the
# others. A page that waits for the answer to each kind of request, as ours does, stays far below.
MOST_A_SECOND = 400
MOST_CHARACTERS_A_SECOND = 20 * MOST_CHARACTERS
BURST_S = 1.0

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Any, Any], Awaitable[None]]


def make_app(session: Session, port: int, token: str) -> App:
    """Make the ASGI application; it refuses requests without the token, under another host's name or from another page.

    Parameters
    ----------
    session : Session
    port : int
        Port that the server listens on; the host and origin of a request must name it.
    token : str
        First part of every path.
    """
    applications, responses, routing = (
        optional_library(f"starlette.{name}", EXTRA) for name in ("applications", "responses", "routing")
    )
    hosts = (f"{HOST}:{port}", f"localhost:{port}")

    async def file(request: Any) -> Any:
        name, kind = FILES[request.path_params.get("name", "")]
        return responses.Response((TEMPLATES / name).read_bytes(), media_type=kind, headers=HEADERS)

    async def live(socket: Any) -> None:
        await socket.accept()
        loop = asyncio.get_running_loop()
        outgoing = asyncio.Queue[bytes]()

        def send(header: Header, buffers: Sequence[bytes]) -> None:
            loop.call_soon_threadsafe(outgoing.put_nowait, packed(header, buffers))

        async def forward() -> None:
            while True:
                await socket.send_bytes(await outgoing.get())

        session.connect(send)
        sending, due_s = asyncio.create_task(forward()), 0.0
        try:
            while (message := await socket.receive())["type"] == "websocket.receive":
                text = message.get("text") or ""
                due_s = max(due_s, loop.time() - BURST_S) + 1 / MOST_A_SECOND + len(text) / MOST_CHARACTERS_A_SECOND
                await asyncio.sleep(max(0.0, due_s - loop.time()))  # meanwhile the page's messages stay unread
                session.take(text, send)
        finally:
            sending.cancel()
            session.disconnect(send)

    routes = [
        routing.Route(f"/{token}/", file),
        routing.Route(f"/{token}/{{name:str}}", file),
        routing.WebSocketRoute(f"/{token}/live", live),
    ]
    inner = applications.Starlette(routes=routes)

    async def guarded(scope: Scope, receive: Any, send: Any) -> None:
        if scope["type"] == "lifespan":
            await inner(scope, receive, send)
        elif why := refusal(scope, hosts, token):
            await _refuse(scope, receive, send, responses.PlainTextResponse(f"{why}\n", 403, headers=HEADERS))
        else:
            await inner(scope, receive, send)

    return guarded


def refusal(scope: Scope, hosts: Sequence[str], token: str) -> str | None:
    """Return why a request is refused; None if it is allowed.

    A WebSocket has to state its origin, because another site's page can open one without asking; a browser always
    states it.
    """
    headers = [(name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in scope["headers"]]
    given = {name: [value for other, value in headers if other == name] for name in ("host", "origin")}
    path = scope["path"].split("/")
    if len(given["host"]) != 1 or given["host"][0] not in hosts:
        return "Host: not this machine's address; open the address that rodcone explore printed"
    origins = [f"http://{given['host'][0]}"]
    if given["origin"] not in ([origins] if scope["type"] == "websocket" else [[], origins]):
        return "Origin: not this page's; open the address that rodcone explore printed"
    if len(path) != 3 or not hmac.compare_digest(path[1].encode(), token.encode()):
        return "token: wrong or missing; open the address that rodcone explore printed"
    if scope["type"] == "http" and (scope["method"] not in ("GET", "HEAD") or path[2] not in FILES):
        return "request: not a file of this page"
    if scope["type"] == "websocket" and path[2] != "live":
        return "request: not this page's connection"
    return None


async def _refuse(scope: Scope, receive: Any, send: Any, response: Any) -> None:
    """Send a refusal before anything is read; a WebSocket is closed before it opens, which the browser sees as 403."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
    else:
        await response(scope, receive, send)


def packed(header: Header, buffers: Sequence[bytes]) -> bytes:
    """Pack one message: the header's length in 32 bits, the header as JSON with the buffers' lengths, the buffers."""
    text = json.dumps(header | {"lengths": [len(buffer) for buffer in buffers]}, allow_nan=False).encode()
    return b"".join((struct.pack("<I", len(text)), text, *buffers))


def listen(port: int) -> socket.socket:
    """Open a socket that only this machine can reach; port 0 chooses a free port.

    Raises
    ------
    InputError
        For a number that is no port, or a port that is in use.
    """
    require_whole("port", port, 0, 65_535, "give a port of this machine, 0 for a free one")
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen()  # before the address is printed, so that a browser that comes at once isn't refused
    except OSError as error:
        listener.close()
        raise InputError(f"port: {port} can't be listened on ({error.strerror}); leave it out for a free one") from None
    return listener


def require_server() -> None:
    """Raise `InputError` if a library of the server isn't installed; called before a session starts its thread."""
    for name in ("uvicorn", "websockets", "starlette.applications"):
        optional_library(name, EXTRA)


def make_server(session: Session, listener: socket.socket) -> tuple[Any, str]:
    """Return the server, which `run(sockets=[listener])` starts, and the address to open.

    Raises
    ------
    InputError
        Where the extra isn't installed.
    """
    uvicorn = optional_library("uvicorn", EXTRA)
    optional_library("websockets", EXTRA)
    token = secrets.token_urlsafe(32)
    port = listener.getsockname()[1]
    config = uvicorn.Config(
        make_app(session, port, token),
        log_level="warning",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=4 * MOST_CHARACTERS,
        ws_per_message_deflate=False,
        server_header=False,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config), f"http://{HOST}:{port}/{token}/"


def explore(transport: Transport) -> Any:
    """Return the explorer of a rendered scene, which a notebook shows as a cell's last value.

    Parameters
    ----------
    transport : Transport
        As `rodcone.render` returns it.

    Returns
    -------
    anywidget.AnyWidget

    Raises
    ------
    InputError
        Where the extra isn't installed.
    """
    anywidget = optional_library("anywidget", "explore")
    kind = type(
        "Explorer", (anywidget.AnyWidget,), {"_esm": str(own_file("explore.js")), "_css": str(own_file("explore.css"))}
    )
    widget = kind()
    session = Session(of_transport(transport))
    loop = _running_loop()

    def send(header: Header, buffers: Any) -> None:
        if loop is None:
            widget.send(header, list(buffers))
        else:  # a notebook's kernel may send messages only from its own thread
            loop.call_soon_threadsafe(widget.send, header, list(buffers))

    session.connect(send)
    widget.on_msg(lambda _, content, __: session.take(json.dumps(content), send))
    widget.session = session  # so that the session lives as long as the widget
    return widget


def _running_loop() -> asyncio.AbstractEventLoop | None:
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None
