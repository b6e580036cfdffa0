"""The form of all links to other sites; ``make docs ARGS=--links`` asks the sites themselves."""

import re
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "benchmarks").glob("*.md")]
SOURCES = [path for name in ("hybrid", "lyapunov", "models") for path in (ROOT / name).rglob("*.py")]
# A link of Markdown ends at the bracket that closes it; some DOIs have brackets.
LINK = re.compile(r"\[([^\]]+)\]\((https?://(?:[^\s()]|\([^\s()]*\))+)\)")
URL = re.compile(r"https?://[^\s`\"'<>|]+")
DOI = re.compile(r"10\.\d{4,9}/[^\s]+")
# DOIs in prose, "doi:10...", and in links.
NAMED = re.compile(r"\bdoi:\s*(\S+)|https?://(?:dx\.)?doi\.org/([^\s`\"'<>|]+)", re.IGNORECASE)


def texts(paths):
    return [(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")) for path in paths]


def closed(text):
    """A link or a DOI in prose without what follows it: punctuation, and brackets that it does not open."""
    text = re.split(r"\]\(|[;\\]", text)[0].rstrip(".,:*")
    while text.endswith((")", "]")) and text.count(text[-1]) > text.count("(["[")]".index(text[-1])]):
        text = text[:-1].rstrip(".,:")
    return text


def dois_in(text):
    return [closed(found[1] or found[2]) for found in NAMED.finditer(text)]


def test_links_are_secure():
    # A server on this machine has no certificate; its address is made when it starts.
    local = ("http://localhost", "http://127.0.0.1", "http://{")
    for page, text in texts([*PAGES, *SOURCES]):
        plain = [url for url in URL.findall(text) if url.startswith("http:")]
        assert [url for url in plain if not url.startswith(local)] == [], page


def test_dois_are_well_formed():
    for page, text in texts([*PAGES, *SOURCES]):
        assert [doi for doi in dois_in(text) if not DOI.fullmatch(doi)] == [], page


def test_a_work_has_one_doi_and_a_link_one_place():
    """The text "doi:..." of a link is its address, and no address is written in two ways."""
    written = defaultdict(set)
    for page, text in texts(PAGES):
        for shown, url in LINK.findall(text):
            written[url.rstrip("/").lower()].add(url)
            if shown.startswith("doi:"):
                assert url == f"https://doi.org/{shown.removeprefix('doi:')}", page
            if shown.startswith("arXiv:"):
                assert url == f"https://arxiv.org/abs/{shown.removeprefix('arXiv:')}", page
    assert {key: urls for key, urls in written.items() if len(urls) > 1} == {}


def test_the_same_work_is_cited_with_the_same_doi():
    """Of two DOIs none is the other with a letter more, as a bracket or a full stop that was taken along."""
    dois = {doi.lower() for _, text in texts([*PAGES, *SOURCES]) for doi in dois_in(text)}
    assert len(dois) > 10
    longer = {(one, other) for one in dois for other in dois if one != other and other.startswith(one)}
    assert longer == set()
