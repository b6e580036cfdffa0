"""Every Python block of the documentation runs, in order, in one namespace per page."""

import ast
import contextlib
import io
import re
import tokenize
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import xarray

mpl.use("Agg")

import matplotlib.pyplot as plt

import hybrid
import hybrid.testing
import lyapunov
import models

ROOT = Path(__file__).parents[1]
README, TOUR, NAMES = ROOT / "README.md", ROOT / "docs" / "tour.md", ROOT / "docs" / "names.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md")), ROOT / "benchmarks" / "README.md"]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
LINK = re.compile(r"\]\((?!https?://)([^)#]+)\)")


def run(page):
    """The namespace after the page's blocks, the printed text, and the comments whose numbers do not hold."""
    text = page.read_text(encoding="utf-8")
    namespace, printed, wrong = {"__name__": "page"}, io.StringIO(), []
    with contextlib.redirect_stdout(printed):
        for block in BLOCK.finditer(text):
            # Keep the line numbers of the page, for tracebacks.
            source = "\n" * text.count("\n", 0, block.start(1)) + block[1]
            comments = comments_of(source)
            for statement in ast.parse(source).body:
                if not isinstance(statement, ast.Expr):
                    exec(compile(ast.Module([statement], []), str(page), "exec"), namespace)
                    continue
                start = printed.tell()
                value = eval(compile(ast.Expression(statement.value), str(page), "eval"), namespace)
                shown = [*numbers_of(value), *map(float, NUMBER.findall(printed.getvalue()[start:]))]
                comment = comments.get(statement.end_lineno, "")
                if not all(is_among(number, shown) for number in NUMBER.findall(comment)):
                    wrong.append((statement.end_lineno, comment, shown[:20]))
    plt.close("all")
    return namespace, printed.getvalue(), wrong


def comments_of(source):
    """The comments of a block by their lines; that of an expression's last line says what it gives."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {token.start[0]: token.string for token in tokens if token.type == tokenize.COMMENT}


def numbers_of(value):
    """All numbers of a value: of an array its shape too, of other objects those that they print."""
    if isinstance(value, (list, tuple)):
        return [len(value), *(number for item in value for number in numbers_of(item))]
    array = np.asarray(None if isinstance(value, xarray.Dataset) else value)
    if array.dtype.kind in "iufc":
        return [*array.shape, *array.real.ravel().tolist(), *array.imag.ravel().tolist()]
    return [float(number) for number in NUMBER.findall(repr(value))]


def is_among(text, numbers):
    """Whether one of the numbers is the one that is written, within one unit of its last digit."""
    digits, _, exponent = text.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    exact = "." not in text and not exponent
    return any(abs(float(text) - number) <= (1e-9 if exact else 1.0001 * unit) for number in numbers)


# A run that goes on from the end of another begins at the very numbers with which that ended.
GO_ON = ("dwell.md", "save-and-resume.md")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.as_given if page.name in GO_ON else (), id=page.name)
        for page in PAGES
        if page != TOUR
    ],
)
def test_blocks_run_and_print_what_their_comments_say(page):
    assert run(page)[2] == []


def test_the_tour_shows_what_it_says():
    names, printed, wrong = run(TOUR)
    assert wrong == []
    assert names["spectrum"].exponents == pytest.approx([0.298, -0.578], abs=0.02)
    assert names["spectrum"].sum_defect == pytest.approx(0.0, abs=1e-10)
    np.testing.assert_allclose(names["touch"].saltation, np.eye(2), atol=1e-10)
    impact = names["impact"]
    assert (impact.x_minus[1], impact.x_plus[1]) == pytest.approx((-2.6065, 2.3458), abs=1e-4)
    assert np.diag(impact.saltation) == pytest.approx([-0.9, -0.9])
    orbit = names["orbit"]
    assert orbit.status.ok
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), [-3.401, -0.0867], rtol=1e-3)
    assert orbit.signature == ("buffer", "free", "free", "free", "free", "buffer")
    assert lyapunov.floquet_exponents(orbit) == pytest.approx([0.312, -0.623], abs=1e-3)
    assert names["strobe"].x.shape == (2000, 2)
    assert len(names["peaks"]) == 500
    assert (names["swept"].status == 0).all()
    assert 0.0 < names["swept"].exponents.max() < 0.4
    assert names["report"].jumps.keys() == {"impact", "touch", "leave"}
    assert not names["report"].never_seen
    # The state of the smallest case depends on which numbers Hypothesis draws.
    assert "jacobian: entry D_v of v is -0.15 at t = 0, x = (" in printed
    assert "the complex step of the field gives -0.15006" in printed
    assert "case: parameters c = 0.15006, the others as declared" in printed


def test_the_readme_is_short_and_so_is_its_model():
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    first = BLOCK.search(text)[1]
    assert len([line for line in first.splitlines() if line.strip()]) <= 18
    assert first == BLOCK.search(TOUR.read_text(encoding="utf-8"))[1]


def test_the_first_model_of_a_newcomer_is_short():
    first = BLOCK.search((ROOT / "docs" / "newcomer.md").read_text(encoding="utf-8"))[1]
    lines = [line for line in first.splitlines() if line.strip() and not line.startswith(("import", "from"))]
    assert len(lines) <= 15


def test_the_page_of_names_has_all_there_is():
    text = NAMES.read_text(encoding="utf-8")
    public = [*hybrid.__all__, *(name for name in lyapunov.__all__ if name.islower())]
    public += hybrid.testing.__all__
    public += [name for name in vars(models) if callable(getattr(models, name))]
    missing = [name for name in public if f"`{name}`" not in text and f"{name}`" not in text]
    results = {"HybridArc", "Jump", "PeriodicOrbit", "Section"}
    assert not set(missing) - results, missing


def test_the_page_on_statuses_has_one_row_per_code():
    text = (ROOT / "docs" / "status.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([A-Z_]+)` \| .+ \| .+ \|$", text, re.MULTILINE)
    assert sorted(rows) == sorted(code.name for code in hybrid.StatusCode)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_what_is_cited_is_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {hybrid.__version__}\n" in citation
    [page] = re.findall(r"docs/\w+\.md", citation)
    assert f"`hybrid-systems {hybrid.__version__}`" in (ROOT / page).read_text(encoding="utf-8")
    assert f"\n## [{hybrid.__version__}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for page in ("README.md", "docs/index.md"):
        assert f"This is version {hybrid.__version__}" in " ".join((ROOT / page).read_text("utf-8").split())


def test_the_tests_to_read_first_are_there():
    tests = Path(__file__).parent
    named = re.findall(r"^\| `(\S+\.py)` \|", (tests / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(named) == 20
    assert [name for name in named if not (tests / name).is_file()] == []
