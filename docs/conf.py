"""Settings of the documentation site: `make docs` builds it into build/docs."""

import sys
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "site"))

with (HERE.parent / "pyproject.toml").open("rb") as file:
    _project = tomllib.load(file)["project"]

project = "slamduel"
author = "The slamduel developers"
project_copyright = author
version = release = _project["version"]

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton", "equations", "mathml"]
exclude_patterns = ["site"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
suppress_warnings = ["misc.highlighting_failure"]

# Notebooks run when the site is built; one that fails ends the build.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 900  # s a cell: the machine may be busy
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
default_role = "code"
html_math_renderer = "mathml"

html_theme = "furo"
html_title = f"slamduel {version}"
html_copy_source = False
html_show_sphinx = False
html_favicon = "site/static/icon.svg"
html_static_path = ["site/static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_theme_options = {"top_of_page_buttons": []}


def setup(app: Any) -> None:
    """Has signatures name arrays by what they hold, and the headings of the contents say their level."""
    app.connect("autodoc-process-signature", _short)
    app.connect("html-page-context", _levelled, priority=900)


def _levelled(*given: Any) -> None:
    """Gives the theme's headings the attribute that their role requires."""
    context = given[3]
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def _short(*given: Any) -> Any:
    """Replaces the types of arrays in the last two arguments, a signature and what is returned."""
    return tuple(None if text is None else _named(text) for text in given[-2:])


def _named(text: str) -> str:
    for kind, word in (("float64", "Array"), ("int64", "Ints"), ("bool", "Bools")):
        text = text.replace("~", "").replace("numpy.", "").replace("typing.", "")
        text = text.replace(f"ndarray[tuple[Any, ...], dtype[{kind}]]", word)
    return text
