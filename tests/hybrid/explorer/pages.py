"""Pages without a browser, and systems to open them with."""

from hybrid import Guard, HybridSystem, Mode, Transition
from hybrid.explorer.page import Page
from hybrid.explorer.subject import subject

IMPORTS = "import hybrid\nimport lyapunov\nimport matplotlib.pyplot as plt\nimport numpy as np\n\n"


def page_of(factory, *, query=None, **options):
    text = f"{IMPORTS}from models import {factory.__name__}\n\nsystem = {factory.__name__}()\n"
    page = Page(subject(factory(), text, **options), {"columns": "12", **(query or {})}, lambda act: act())
    assert page.worker.wait(120)
    return page


def said(page):
    """All that the page says, from its top."""
    return " ".join(each.text for each in page.widgets.messages.values())


RELAY = HybridSystem(
    state=("q",),
    parameters={"d": 0.5},
    modes=[Mode("up", lambda t, x, p: (1.0,)), Mode("down", lambda t, x, p: (-1.0,))],
    transitions=[
        Transition("up", "down", Guard(lambda t, x, p: x.q - p.d, +1)),
        Transition("down", "up", Guard(lambda t, x, p: x.q + p.d, -1)),
    ],
)
FALL = HybridSystem(
    state=("q", "v"),
    modes=[Mode("fall", lambda t, x, p: (x.v, -9.81))],
    transitions=[Transition("fall", None, Guard(lambda t, x, p: x.q, -1), name="ground")],
)
