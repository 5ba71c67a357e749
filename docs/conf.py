"""Sphinx configuration of `make docs`; the source folder is the repository's root."""

import os
import re
from importlib.metadata import files
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx

from voxelpose.version import __version__

project = "voxelpose"
author = "the voxelpose authors"
copyright = "2026, the voxelpose authors"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
]
root_doc = "README"
include_patterns = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/*.md",
    "docs/names.rst",
    "docs/reference/*/*.rst",
]
html_theme = "furo"
html_title = f"voxelpose {__version__}"
html_show_sphinx = False

# MathJax from its wheel, so that the pages need no network.
mathjax_path = "tex-svg.js"
html_static_path = [
    str(path.locate())
    for path in files("django-static-mathjax") or ()
    if path.name == mathjax_path and path.parent.name == "es5"
]

myst_heading_anchors = 4
myst_fence_as_directive = ["math"]  # ```math, as GitHub writes equations
# Short names in annotations are ambiguous, and a guide may skip a heading level.
suppress_warnings = ["ref.python", "myst.header"]

# Docstrings write `name` for code, as comments do.
default_role = "code"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

_ROOT = Path(__file__).parents[1]
_PACKAGES = ("voxelpose", "silhouette_core", "calib")
# Document each name in its own module only. (Sphinx 9 applies the setting of that name to modules,
# not to packages.)
os.environ["SPHINX_APIDOC_OPTIONS"] = "members,show-inheritance,ignore-module-all"
_COMMANDS = "batch/batch_command.py", "setup_page/setup_command.py", "studio/studio_command.py"
apidoc_modules = [
    {
        "path": str(_ROOT / package),
        "destination": f"docs/reference/{package}",
        "exclude_patterns": [
            str(_ROOT / package / name)
            for name in ("**/kernels", "**/kernels/*", "cli", "cli/*", *_COMMANDS, "__main__.py")
        ],
        "separate_modules": False,  # few pages: each carries the list of all pages
        "module_first": True,
    }
    for package in _PACKAGES
]
exclude_patterns = ["docs/reference/*/modules.rst"]

_GUIDE = (
    "install guide studio live recordings setup calibration checking viewing exports python"
    " glossary results"
).split()
_PROJECT = ["docs/architecture", "docs/papers", "docs/decisions", "CONTRIBUTING", "CHANGELOG"]
_LISTED = {*_GUIDE, *(Path(page).stem for page in _PROJECT)}
_OTHERS = sorted({path.stem for path in (_ROOT / "docs").glob("*.md")} - _LISTED)


def _toctree(caption: str, pages: list[str]) -> str:
    return "\n".join(
        ["", "```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""]
    )


def _add_pages(app: Sphinx, page: str, source: list[str]) -> None:
    """Add the lists of pages to the front page, the README, which needs none on GitHub."""
    if page == root_doc:
        source[0] += _toctree("User guide", [f"docs/{name}" for name in (*_GUIDE, *_OTHERS)])
        source[0] += _toctree(
            "Reference",
            ["docs/names", *(f"docs/reference/{package}/{package}" for package in _PACKAGES)],
        )
        source[0] += _toctree("The project", _PROJECT)


def _link_names(app: Sphinx, page: str, source: list[str]) -> None:
    """Link the functions in the map of the papers to the reference instead of the source files."""
    if page == "docs/papers":
        source[0] = re.sub(
            r"\[`([\w.]*?(\w+\.\w+))`\]\([\w./]+\.py\)", r"{py:obj}`\2 <\1>`", source[0]
        )


def _number_equations(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Number the papers' equations as the papers do: (A 9) is eq. (9) of paper A."""
    papers = {"okada": "A", "okada-step": "A, step", "iiyama": "B, step"}
    for equation in doctree.findall(nodes.math_block):
        paper, _, number = (equation.get("label") or "").rpartition("-")
        if number.isdigit():
            equation["number"] = f"{papers[paper]} {number}"


def _escape_bars(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Escape the bars of |A|, which would start a substitution; code and equations are kept."""
    in_equation = False
    for number, line in enumerate(lines):
        in_equation = line.lstrip().startswith(".. math::") or (
            in_equation and (not line.strip() or line.startswith(" "))
        )
        if not in_equation:
            lines[number] = re.sub(r"(`[^`]*`)|\|", lambda bar: bar[1] or r"\|", line)


def setup(app: Sphinx) -> None:
    """Connect the functions above."""
    app.connect("autodoc-process-docstring", _escape_bars)
    app.connect("doctree-resolved", _number_equations)
    app.connect("source-read", _add_pages)
    app.connect("source-read", _link_names)
