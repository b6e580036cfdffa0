"""Settings of the site: ``make docs`` builds it with ``docs/make_site.py``, which copies this file."""

import sys
from pathlib import Path

from numpydoc.xref import DEFAULT_LINKS

import hybrid

# make_site.py copies this file and what it imports side by side.
HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from site_types import add_types, classes  # noqa: E402

project = "hybrid"
author = "The hybrid-systems developers"
version = release = hybrid.__version__

extensions = [
    # The parser of MyST pages, which executes those that make_site.py makes notebooks of.
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    # Formulas are shown without a network, too.
    "sphinx-mathjax-offline",
    "sphinx_design",
]
source_suffix = {".md": "myst-nb"}
# For download.
exclude_patterns = ["notebooks"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
# Links to headings have the same form as where the pages are read without the site.
myst_heading_anchors = 4

nb_execution_mode = "force"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
# Progress bars and the note of a first compilation.
nb_output_stderr = "remove"
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
# Types lead to the pages of the classes that they name; those of other packages have none here.
numpydoc_xref_param_type = True
numpydoc_xref_aliases = {word: word for word in DEFAULT_LINKS} | classes()
numpydoc_xref_ignore = "all"
# docs/make_site.py writes the pages of the names.
autosummary_generate = False
add_module_names = False
toc_object_entries_show_parents = "hide"

# `make docs ARGS=--links`; publishers that refuse programs are shown as broken.
linkcheck_timeout = 20
linkcheck_retries = 2
linkcheck_anchors = False

html_theme = "pydata_sphinx_theme"
html_title = "hybrid"
html_favicon = "icon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_search_scorer = str(HERE / "search_scorer.js")
html_theme_options = {
    "show_prev_next": False,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_end": [],
}
# A part without pages of its own needs no list of pages beside it.
html_sidebars = {"i-want-to": [], "gallery": []}


def readable_defaults(app, what, name, thing, options, signature, returned):
    """A default that is made anew for each object is shown as dots."""
    return (signature or "").replace("=NOTHING", "=...") or signature, returned


def setup(app):
    app.connect("autodoc-process-signature", readable_defaults)
    # Before numpydoc, whose priority is 500.
    app.connect("autodoc-process-docstring", add_types, priority=400)
