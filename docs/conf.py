"""Settings by which Sphinx builds these pages (``make docs``); it needs no internet."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.application import Sphinx

HERE = Path(__file__).parent
OWN = f"{HERE.parent}/"
sys.path.insert(0, str(HERE))

import api_pages  # noqa: E402
import code_tables  # noqa: E402
import drawings  # noqa: E402
import level_tables  # noqa: E402

import rtradar  # noqa: E402

project, author, release = "rtradar", "rtradar developers", rtradar.__version__
project_copyright = author
extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc", "sphinx_gallery.gen_gallery"]
# The gallery's pages are its .rst files; their notebooks are for download.
exclude_patterns = ["gallery", "auto_gallery/*.ipynb"]
default_role = "py:obj"
html_theme = "furo"
html_title = f"rtradar {release}"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_math_renderer = "mathml"
html_show_sourcelink = False
numpydoc_show_class_members = False
autodoc_typehints = "none"  # the docstrings say more: shapes, units
autodoc_member_order = "bysource"

# The notebook is stored without what it prints and draws, and is executed for its page.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"[0-9]_\w+\.py",
    "within_subsection_order": "FileNameSortKey",  # else the training comes before its data set
    "abort_on_example_error": True,
    "download_all_examples": False,
    "write_computation_times": False,
    "min_reported_time": 3600,
    "reset_modules": (),
}
# Gallery scripts write into the folder that is named here, not into the sources.
os.environ.setdefault("RTRADAR_GALLERY_OUT", str(HERE.parent / "out" / "gallery"))
os.environ.pop("RTRADAR_MOCAP", None)


FUNCTION = r"(\\(?:arcsin|sin|cos|tan|det)\b(?:\^\d)?)"
BAR = '<mo stretchy="false">|</mo>'


def mathml(node: nodes.math | nodes.math_block, **how: bool) -> str:
    """Return a formula as MathML, with space around functions and none within bars."""
    text = re.sub(rf"(?<=[\w)}}]) {FUNCTION}", r"\\,\1", node.astext())
    text = re.sub(rf"{FUNCTION} (?=[\w\\])", r"\1\\,", text)
    found: str = latex2mathml.tex2mathml(text, **how)
    return found.replace(BAR, BAR.replace(">|", ' lspace="0" rspace="0">|'))


def inline_math(page: Any, node: nodes.math) -> None:
    """A formula within a line, as MathML, which browsers draw without help."""
    page.body.append(mathml(node))
    raise nodes.SkipNode


def displayed_math(page: Any, node: nodes.math_block) -> None:
    """A displayed formula with its number and, where it has one, the label that docstrings cite."""
    page.body.append(page.starttag(node, "div", CLASS="math"))
    if node["number"]:
        page.body.append(f'<span class="eqno">({node["number"]}) <small>{node["label"]}</small>')
        page.add_permalink_ref(node, "Link to this equation")
        page.body.append("</span>")
    page.body.append(mathml(node, as_block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Teach Sphinx MathML, and tables and names from the code; draw, and write the API's pages."""
    code_tables.TABLES.update(level_tables.TABLES)
    app.add_directive("from-code", code_tables.CodeTable)
    app.add_role("names", level_tables.names_role)
    app.add_html_math_renderer("mathml", (inline_math, None), (displayed_math, None))
    # What scripts of the gallery print names the folder of this checkout.
    app.connect("source-read", lambda app, name, text: text.append(text.pop().replace(OWN, "")))
    app.connect("builder-inited", lambda app: api_pages.write(Path(app.srcdir) / "api"))
    app.connect("builder-inited", lambda app: drawings.draw(Path(app.srcdir) / "drawn"))
