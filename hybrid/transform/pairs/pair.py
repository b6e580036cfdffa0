"""A pair of quantities that are not negative, of which one is zero."""

from __future__ import annotations

from typing import Any

import attrs

from hybrid.errors import ModelError, shown
from hybrid.system.elements import Function
from hybrid.system.members import is_identifier
from hybrid.system.portable import Portable

# Names of modes.
NONE_ACTIVE, BEGINNING = "free", "begins"
NAME = "be a name that can be written as an attribute"


@attrs.frozen
class Pair(Portable):
    """Two quantities ``w >= 0`` and ``z >= 0`` of which one is zero, such as those of an ideal diode.

    ``z`` is an unknown of the equations, which read it as ``z.name``; ``w`` is a function. Of a diode, one is
    the current and the other the voltage in the reverse direction, whichever the equations need.

    Parameters
    ----------
    name
        The equations read ``z.name``; outputs are ``name.w`` and ``name.z``. In a mode that is named by the
        pair, ``z`` may be positive, and ``w`` is zero.
    w
        ``w(t, x, z, p)``, affine in ``z``.
    says
        What the name of a mode says where ``z`` may be positive, such as ``"blocks"``: the mode is then
        ``diode blocks`` and not ``diode``.

    Raises
    ------
    ModelError
        If the name is no attribute or that of a mode, ``w`` is not callable, or ``says`` is no plain text.

    Examples
    --------
    >>> from hybrid import Pair
    >>> diode = Pair("diode", w=lambda t, x, z, p: x.i, says="blocks")
    >>> diode.label
    'diode blocks'
    """

    name: str
    w: Function
    says: str = attrs.field(default="", kw_only=True)

    def __attrs_post_init__(self) -> None:
        if not is_identifier(self.name) or self.name in (NONE_ACTIVE, BEGINNING):
            raise ModelError(
                f"Pair: name must {NAME}, and not be {NONE_ACTIVE!r} or {BEGINNING!r}, which name modes; got "
                f"{shown(self.name)}."
            )
        if not callable(self.w):
            raise ModelError(f"{self.title}: w must be a function of (t, x, z, p); got {shown(self.w)}.")
        if not isinstance(self.says, str) or any(each in self.says for each in "+,:"):
            raise ModelError(
                f"{self.title}: says must be a text without '+', ',' and ':', which join names in those of "
                f"modes; got {shown(self.says)}."
            )

    @property
    def title(self) -> str:
        """Beginning of error texts."""
        return f"Pair {self.name!r}"

    @property
    def label(self) -> str:
        """The pair in the name of a mode in which ``z`` may be positive."""
        return f"{self.name} {self.says}".strip()


def active_name(pairs: Any, active: tuple[int, ...]) -> str:
    """What the name of a mode says of the pairs whose ``z`` may be positive."""
    return "+".join(pairs[i].label for i in active) or NONE_ACTIVE
