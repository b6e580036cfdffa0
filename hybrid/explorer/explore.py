"""``hybrid.explore``: a page in the browser that is played with."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from html import escape
from typing import Any

from hybrid import arguments
from hybrid.errors import HybridError
from hybrid.explorer.calls import OPENING
from hybrid.explorer.source import Subjects
from hybrid.explorer.subject import subject
from hybrid.simulation.extra import how_to_install
from hybrid.system.graph import HybridSystem

INSTALL = f"hybrid.explore needs Panel and Bokeh. {how_to_install('explore')}"
THE_SYSTEM = "# system is the model that was given to hybrid.explore.\n"
LOCAL = ("localhost", "127.0.0.1", "::1")


class Explorer:
    """A running page.

    Attributes
    ----------
    url
        Its address.
    """

    def __init__(self, url: str, server: Any) -> None:
        self.url, self._server = url, server

    def stop(self) -> None:
        """End the page."""
        self._server.stop()

    def __repr__(self) -> str:
        return f"<Explorer at {self.url}>"

    def _repr_html_(self) -> str:
        url = escape(self.url)
        return (
            f'<p><a href="{url}" target="_blank">{url}</a></p>'
            f'<iframe src="{url}" width="100%" height="900" style="border: 0"></iframe>'
        )


def explore(
    system: HybridSystem,
    x0: Any = None,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    port: int = 0,
    address: str = "localhost",
    block: bool | None = None,
    show: bool | None = None,
) -> Explorer:
    """Open a page with sliders and live pictures of a system in the browser.

    Parameters
    ----------
    system
        The model.
    x0, mode, parameters
        Start, as for :func:`hybrid.simulate`; by default a start from which something happens.
    ranges
        Ends ``(low, high)`` of sliders by parameter; by default half of the value to one and a half.
    port, address
        Where the page listens: by default at a free port of this machine, for this machine only.
    block
        Whether to wait until Ctrl-C: by default in a script, and not in a notebook or at a prompt.
    show
        Whether to open a browser: by default if the call waits. A notebook shows the page that is returned.

    Returns
    -------
    Explorer
        With ``.url`` and ``.stop()``.

    Raises
    ------
    ArgumentError
        If an argument does not fit the system, or no start is found.
    HybridError
        If Panel is not installed.
    """
    found = subject(system, OPENING + "\n" + THE_SYSTEM, x0, mode=mode, parameters=parameters, ranges=ranges)
    return serve(lambda: (found, ""), port=port, address=address, block=block, show=show)


def serve(
    subjects: Subjects,
    *,
    port: int = 0,
    address: str = "localhost",
    block: bool | None = None,
    show: bool | None = None,
) -> Explorer:
    """Serve the page of the model that ``subjects`` gives whenever a page is opened; as :func:`explore`."""
    port = arguments.count("port", port, 0, 65535)
    arguments.instance("address", address, str, "Name the address of this machine to listen at.")
    block = _waits() if block is None else arguments.flag("block", block)
    show = block if show is None else arguments.flag("show", show)
    try:
        from hybrid.explorer.server import started
    except ImportError as error:
        raise HybridError(INSTALL) from error
    server, url = started(subjects, port, address)
    if address not in LOCAL:
        print(
            f"hybrid: the page listens at {address}; whoever reaches that address can use it.",
            file=sys.stderr,
        )
    explorer = Explorer(url, server)
    if show:
        import webbrowser

        webbrowser.open(url)
    if block:
        print(f"hybrid: the page is at {url}. Press Ctrl-C to end it.", flush=True)
        try:
            server.wait()
        except KeyboardInterrupt:
            print("hybrid: the page has ended.")
        finally:
            explorer.stop()
    return explorer


def _waits() -> bool:
    """Whether nothing follows by hand: no prompt, no notebook."""
    return not (hasattr(sys, "ps1") or sys.flags.interactive or "ipykernel" in sys.modules)
