"""Settings of the site: ``make docs`` builds it with ``docs/make_site.py``, which copies this file."""

import hybrid

project = "hybrid"
author = "The hybrid-systems developers"
version = release = hybrid.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    # Formulas are shown without a network, too.
    "sphinx-mathjax-offline",
    "sphinx_design",
]
source_suffix = {".md": "markdown"}
myst_enable_extensions = ["colon_fence", "dollarmath"]
# Links to headings have the same form as where the pages are read without the site.
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
# docs/make_site.py writes the pages of the names.
autosummary_generate = False
add_module_names = False

html_theme = "pydata_sphinx_theme"
html_title = "hybrid"
html_show_sourcelink = False
html_theme_options = {
    "show_prev_next": False,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_end": [],
}
# A part without pages of its own needs no list of pages beside it.
html_sidebars = {"i-want-to": [], "gallery": []}
