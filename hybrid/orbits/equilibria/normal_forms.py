"""Normal forms of the bifurcations of an equilibrium, from exact derivatives of second and third order."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.equilibria.equations import Equations, Reduced

# The equations that hold at a branch point are solved to this size, in units of the unknowns.
SMALL, MOST_STEPS = 1e-13, 20


@attrs.frozen(eq=False)
class Hopf:
    """A pair of eigenvalues on the imaginary axis.

    Attributes
    ----------
    omega
        Its imaginary part, positive: the angular frequency of the small cycles.
    vector
        Its eigenvector ``(n,)``, of length 1.
    first
        The first Lyapunov coefficient; negative if the cycles attract within the centre manifold.
    speed
        How fast the real part grows with the parameter.
    """

    omega: float
    vector: np.ndarray
    first: float
    speed: float

    @property
    def side(self) -> float:
        """On which side of the parameter the cycles are: positive for larger values."""
        return -self.first * self.speed


def critical_pair(matrix: np.ndarray) -> complex:
    """The eigenvalue with a positive imaginary part that is nearest to the imaginary axis, or nan."""
    own = np.linalg.eigvals(matrix)
    above = own[own.imag > 0.0]
    return complex(above[np.argmin(np.abs(above.real))]) if len(above) else complex(np.nan)


def hopf_at(equations: Equations, u: np.ndarray, onward: np.ndarray) -> Hopf:
    """The normal form of a Hopf bifurcation at a point of a branch in the direction ``onward (n + 1,)``."""
    omega, q, p = eigenvectors(equations, u)
    along = equations.rates.second(equations.known(u), np.append(q, 0.0), onward / onward[-1])
    return Hopf(omega, q, lyapunov_at(equations, u, 1), float((p.conj() @ along).real))


def lyapunov_at(equations: Equations, u: np.ndarray, count: int) -> float:
    """The first Lyapunov coefficient at a point with ``count`` parameters among its unknowns.

    For the formula see Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, section 5.4. The eigenvector
    has length 1, and so has its product with the adjoint one.
    """
    n, known, matrix = equations.n, equations.known(u), equations.matrix(u)
    omega, q, p = eigenvectors(equations, u)
    still = np.zeros(count)

    def bent(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return equations.rates.second(known, np.append(one, still), np.append(other, still))

    # On a surface that the mode stays on, the mean displacement stays on it.
    normals = equations.surfaces.jacobian(known)[:, :n]
    curved = equations.surfaces.second(known, np.append(q, still), np.append(q.conj(), still))
    mean = np.linalg.lstsq(
        np.vstack([matrix, normals]), -np.concatenate([bent(q, q.conj()), curved]), rcond=None
    )[0]
    double = np.linalg.solve(2j * omega * np.eye(n) - matrix, bent(q, q))
    third = equations.rates.third(known, *(np.append(each, still) for each in (q, q, q.conj())))
    total = p.conj() @ (third + 2.0 * bent(q, mean) + bent(q.conj(), double))
    return float(total.real) / (2.0 * omega)


def eigenvectors(equations: Equations, u: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """The frequency of the pair nearest to the imaginary axis, its eigenvector and the adjoint one."""
    matrix, value = equations.matrix(u), critical_pair(equations.within(u))
    values, vectors = np.linalg.eig(matrix)
    q = vectors[:, np.argmin(np.abs(values - value))]
    values, vectors = np.linalg.eig(matrix.T)
    p = vectors[:, np.argmin(np.abs(values - value.conjugate()))]
    q = q / np.linalg.norm(q)
    return float(value.imag), q, p / np.conj(p.conj() @ q)


def fold_at(part: Reduced, u: np.ndarray) -> tuple[float, float]:
    """The coefficient ``a = p.B(q, q) / 2`` of a fold, and the side of the parameter on which equilibria are.

    The null vectors ``q`` and ``p`` have length 1 and product 1, as in Kuznetsov, section 3.3.
    """
    bent, product = fold_forms(part, u, 1)
    rows = part.jacobian(u)
    p = np.linalg.svd(rows[:, :-1])[0][:, -1]
    return 0.5 * bent / product, -bent / float(p @ rows[:, -1])


def fold_forms(
    part: Reduced, u: np.ndarray, count: int, like: np.ndarray | None = None
) -> tuple[float, float]:
    """``p.B(q, q)`` and ``p.q`` for null vectors of length 1.

    There are ``count`` parameters among the unknowns. The vector ``q`` points as ``like (n,)`` does.
    """
    left, _, right = np.linalg.svd(part.jacobian(u)[:, :-count])
    q, p = right[-1], left[:, -1]
    if like is not None and q @ like < 0.0:
        q = -q
    whole = np.append(q, np.zeros(count))
    bends = part.second_along(u, whole)
    within = np.concatenate([part.basis.T @ q, np.zeros(len(p) - part.basis.shape[1])])
    return float(p @ bends @ whole), float(p @ within)


def branch_point_near(
    part: Reduced, u: np.ndarray, units: np.ndarray, scales: np.ndarray
) -> np.ndarray | None:
    """The point near ``u (n + 1,)`` at which two branches cross, by Newton's method; None if there is none.

    The ``units`` are those of the unknowns, the ``scales`` those of the equations ``(n,)``.

    The equations are G(u) + m w = 0, w G'(u) = 0, w w = 1 in u, m and w, which are regular there (G. Moore,
    "The numerical treatment of non-trivial bifurcation points", Numer. Funct. Anal. Optim. 2 (1980) 441).
    """
    n = len(u) - 1
    w, m = np.linalg.svd(part.jacobian(u) * units / scales[:, None])[0][:, -1], 0.0
    for _ in range(MOST_STEPS):
        rows = part.jacobian(u) * units / scales[:, None]
        bends = [
            part.second_along(u, unit)[:, :] * units / scales[:, None] * size
            for unit, size in zip(np.eye(n + 1), units, strict=True)
        ]
        hessian = np.array([w @ each for each in bends])
        matrix = np.block(
            [
                [rows, w[:, None], m * np.eye(n)],
                [hessian, np.zeros((n + 1, 1)), rows.T],
                [np.zeros((1, n + 2)), 2.0 * w[None, :]],
            ]
        )
        values = np.concatenate([part.residual(u) / scales + m * w, w @ rows, [w @ w - 1.0]])
        try:
            step = np.linalg.solve(matrix, -values)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all():
            return None
        u, m, w = u + units * step[: n + 1], m + step[n + 1], w + step[n + 2 :]
        if np.abs(step).max() <= SMALL:
            return u
    return u if np.abs(step).max() <= np.sqrt(SMALL) else None


def directions_at(part: Reduced, u: np.ndarray, units: np.ndarray) -> list[np.ndarray]:
    """The directions ``(n + 1,)``, in units, of the two branches through a branch point.

    They are the roots of the quadratic form of the second derivatives (Kuznetsov, section 10.2).
    """
    left, _, right = np.linalg.svd(part.jacobian(u) * units)
    w, one, other = left[:, -1], right[-2], right[-1]

    def form(a: np.ndarray, b: np.ndarray) -> float:
        return float(w @ part.second_along(u, units * a) @ (units * b))

    quadratic = np.array([[form(one, one), form(one, other)], [form(one, other), form(other, other)]])
    values, vectors = np.linalg.eigh(quadratic)
    if not values[0] < 0.0 < values[1]:
        return []
    along = [np.sqrt(values[1]) * vectors[:, 0], np.sqrt(-values[0]) * vectors[:, 1]]
    found = []
    for sign in (1.0, -1.0):
        a, b = along[0] + sign * along[1]
        direction = a * one + b * other
        found.append(direction / np.linalg.norm(direction))
    return found
