"""The server of the page: one thread with its own loop, which listens on this machine."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import panel as pn
from bokeh.events import ConnectionLost
from bokeh.models import CustomJS

from hybrid.errors import ArgumentError, HybridError
from hybrid.explorer.messages import TOP
from hybrid.explorer.page import Page
from hybrid.explorer.source import Subjects

# A telephone shows a page without this line as if it were 980 pixels wide. The location is what lets the page
# change its own address.
TEMPLATE = """
{% extends base %}
{% block preamble %}<meta name="viewport" content="width=device-width, initial-scale=1">{% endblock %}
{% block contents %}{{ embed(roots.page) }}{{ embed(roots.location) }}{% endblock %}
"""


LOST = "<p>The program behind this page has ended. Start it again, and load the page anew.</p>"
# Where a server that listens at all addresses of the machine is found.
HERE = {"0.0.0.0": "127.0.0.1", "": "127.0.0.1", "::": "::1"}
# Seconds between two looks at whether the server listens.
LOOK = 0.02


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


def started(subjects: Subjects, port: int, address: str) -> tuple[Server, str]:
    """A server of the page and its address, which listens already.

    Raises
    ------
    ArgumentError
        If nobody can listen there.
    """
    port = _free(port, address)
    pages: list[Page] = []

    def page() -> Any:
        document = pn.state.curdoc
        subject, problem = subjects()
        query = read_query(pn.state.session_args)
        made = Page(subject, query, document.add_next_tick_callback, problem)
        pages.append(made)

        def closed(_: Any) -> None:
            pages.remove(made)
            # The thread of the server must not wait: other pages are open, and the worker may wait for it.
            made.close(wait=False)

        document.on_session_destroyed(closed)
        # A lost connection is told where everything else is, and not by Bokeh over the page.
        document.config.notify_connection_status = False
        lost = CustomJS(args={"said": made.widgets.messages[TOP]}, code=f"said.text = {LOST!r};")
        document.js_on_event(ConnectionLost, lost)
        framed = pn.Template(TEMPLATE, location=True)
        framed.add_panel("page", made.view)
        return framed

    thread = pn.serve(
        {"/": page},
        port=port,
        address=address,
        websocket_origin=[f"{host}:{port}" for host in {address, "localhost", "127.0.0.1"}],
        threaded=True,
        show=False,
        title=subjects()[0].title,
        verbose=False,
    )
    _await(thread, port, address)
    shown = "localhost" if address in ("127.0.0.1", "::1") else address
    return Server(thread, pages), f"http://{shown}:{port}/"


def _await(thread: Any, port: int, address: str) -> None:
    """Wait until the server listens: its thread opens the port, and a browser may be faster."""
    while thread.is_alive():
        try:
            with socket.create_connection((HERE.get(address, address), port), timeout=1.0):
                return
        except OSError:
            time.sleep(LOOK)
    raise HybridError(f"The server of the page ended before it listened at {address}:{port}.")


def _free(port: int, address: str) -> int:
    """The port, or a free one for 0."""
    try:
        with socket.create_server((address, port)) as probe:
            return int(probe.getsockname()[1])
    except OSError as error:
        raise ArgumentError(
            f"port: nobody can listen at {address}:{port} ({error.strerror}). Use port=0 for a free one."
        ) from error
