"""The explorer in a notebook: the same page, over the notebook's own connection."""

import asyncio
import json
from typing import Any

from render.transport import Transport
from rodcone.optional import optional_library
from studies.explore.messages import Header
from studies.explore.session import Session
from studies.explore.source import of_transport
from studies.pages.page import own_file


def explore(transport: Transport) -> Any:
    """Explorer of a rendered scene, to be shown as a notebook's last value.

    Parameters
    ----------
    transport : Transport
        As `rodcone.render` gives it.

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
    widget, session = kind(), Session(of_transport(transport))
    loop = _running_loop()

    def send(header: Header, buffers: Any) -> None:
        if loop is None:
            widget.send(header, list(buffers))
        else:  # messages of a kernel are sent from its own thread
            loop.call_soon_threadsafe(widget.send, header, list(buffers))

    session.connect(send)
    widget.on_msg(lambda _, content, __: session.take(json.dumps(content), send))
    widget.session = session  # lives as long as the widget
    return widget


def _running_loop() -> asyncio.AbstractEventLoop | None:
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None
