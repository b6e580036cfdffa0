"""The server of the page: one thread with its own loop, which listens on this machine."""

from __future__ import annotations

import socket
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import panel as pn

from hybrid.errors import ArgumentError
from hybrid.explorer.page import Page
from hybrid.explorer.subject import Subject

# A telephone shows a page without this line as if it were 980 pixels wide. The location is what lets the page
# change its own address.
TEMPLATE = """
{% extends base %}
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">{% endblock %}
{% block contents %}{{ embed(roots.page) }}{{ embed(roots.location) }}{% endblock %}
"""


class Server:
    """A server in a thread of its own."""

    def __init__(self, thread: Any, closing: list[Page]) -> None:
        self.thread, self.pages = thread, closing
        self.ended = threading.Event()

    def stop(self) -> None:
        """End the server and the work of its pages."""
        self.ended.set()
        for page in self.pages:
            page.close()
        self.thread.stop()

    def wait(self) -> None:
        """Wait until the server is ended."""
        # A wait with a limit hears Ctrl-C on all systems.
        while not self.ended.wait(0.5):
            pass


def read_query(arguments: Mapping[str, Sequence[bytes]]) -> dict[str, str]:
    """The parts of an address as text; Tornado reads their names as if they were Latin-1."""
    return {
        name.encode("latin-1").decode(errors="replace"): values[0].decode(errors="replace")
        for name, values in arguments.items()
        if values
    }


def started(subject: Subject, port: int, address: str) -> tuple[Server, str]:
    """A server of the page and its address.

    Raises
    ------
    ArgumentError
        If nobody can listen there.
    """
    port = _free(port, address)
    pages: list[Page] = []

    def page() -> Any:
        document = pn.state.curdoc
        query = read_query(pn.state.session_args)
        made = Page(subject, query, document.add_next_tick_callback)
        pages.append(made)

        def closed(_: Any) -> None:
            pages.remove(made)
            # The thread of the server must not wait: other pages are open, and the worker may wait for it.
            made.close(wait=False)

        document.on_session_destroyed(closed)
        framed = pn.Template(TEMPLATE, location=True)
        framed.add_panel("page", made.view)
        return framed

    title = subject.system.name or "Hybrid system"
    thread = pn.serve(
        {"/": page},
        port=port,
        address=address,
        websocket_origin=[f"{host}:{port}" for host in {address, "localhost", "127.0.0.1"}],
        threaded=True,
        show=False,
        title=title,
        verbose=False,
    )
    shown = "localhost" if address in ("127.0.0.1", "::1") else address
    return Server(thread, pages), f"http://{shown}:{port}/"


def _free(port: int, address: str) -> int:
    """The port, or a free one for 0."""
    try:
        with socket.create_server((address, port)) as probe:
            return int(probe.getsockname()[1])
    except OSError as error:
        raise ArgumentError(
            f"port: nobody can listen at {address}:{port} ({error.strerror}). Use port=0 for a free one."
        ) from error
