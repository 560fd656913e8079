"""The site: sphinx-build -W -c docs . build/site

Its pages are those that a reader of the repository sees: README, CHANGELOG, CONTRIBUTING and docs/.
Added while it is built are the keys of files, the commands, the names of Python, and the list of
pages beside each page. Nothing is fetched, neither here nor by a page in a browser.
"""

import re
import sys
from functools import partial
from pathlib import Path

from docutils import nodes

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.generators import commands, docstrings, keys, navigation  # noqa: E402

project = "chamberopt"
author = "chamberopt developers"
root_doc = "docs/README"
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**.md"]
html_additional_pages = {"index": "to_the_first_page.html"}

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["attrs_block", "attrs_inline"]
myst_heading_anchors = 4

autodoc_member_order = "groupwise"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True, "exclude-members": "model_config"}
napoleon_numpy_docstring = False
napoleon_use_ivar = True
highlight_language = "none"
toc_object_entries_show_parents = "hide"
python_use_unqualified_type_names = True

html_theme = "furo"  # light and dark, narrow and wide
html_title = "chamberopt"
html_static_path = ["static"]
templates_path = ["templates"]
html_css_files = ["site.css"]
html_copy_source = False
html_domain_indices = False
html_use_index = False
html_show_copyright = False
html_show_sphinx = False
html_search_scorer = "docs/templates/scorer.js"

# What is made from the program stands at the end of these pages.
MADE = {
    root_doc: navigation.section,
    "docs/reference/commands": commands.section,
    **{page: partial(keys.of_file, model) for page, model in keys.PAGES.items()},
}


# A link whose label is the file's name has the page's title on the site: [page.md](how_to/page.md)
NAMED_BY_FILE = re.compile(r"\[[\w/.]*?(\w+\.md)\](?=\([\w/.]*?\1(#[^)]*)?\))")


def prepare(app, page: str, source: list[str]) -> None:
    """Add the text that is made from the program to a page, and take file names out of links."""
    source[0] = NAMED_BY_FILE.sub("[]", source[0])
    if page in MADE:
        source[0] += "\n\n" + MADE[page]()


def make_keys_linkable(app, tree: nodes.document) -> None:
    """Let pages link to a key, as in [time](../reference/design.md#process-treatment_time_s)."""
    slugs = app.env.metadata[app.env.current_document.docname].setdefault("myst_slugs", {})
    for node in tree.findall(nodes.inline):
        for name in node.get("names", []):
            slugs[name] = (0, node["ids"][0], node.astext())


def setup(app) -> None:
    """Called by Sphinx before it reads the pages."""
    app.connect("source-read", prepare)
    app.connect("doctree-read", make_keys_linkable)
    app.connect("autodoc-process-docstring", docstrings.adapt, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", docstrings.shorten)
    app.connect("env-get-outdated", lambda *_: [*MADE, "docs/reference/python"])
