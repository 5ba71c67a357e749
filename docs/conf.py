"""How Sphinx makes the pages: `make docs`. The source folder is the repository's root, so that
links lead where they lead on GitHub.
"""

import os
import re
from pathlib import Path

from sphinx.application import Sphinx

from voxelpose import __version__

project = "voxelpose"
author = "the voxelpose authors"
copyright = "2026, the voxelpose authors"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.apidoc"]
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

myst_heading_anchors = 4
# Names in annotations are short, so some have several homes; and a guide may go from # to ###.
suppress_warnings = ["ref.python", "myst.header"]

# Docstrings write `name` for code, as comments do.
default_role = "code"
autodoc_typehints_format = "short"
autodoc_mock_imports = ["skimage"]  # only who makes body templates anew needs it
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

_ROOT = Path(__file__).parents[1]
_PACKAGES = ("voxelpose", "silhouette_core", "calib")
# Each name in its own module, not also where a package shows it on. (Sphinx 9 heeds the setting of
# that name for modules, not packages.)
os.environ["SPHINX_APIDOC_OPTIONS"] = "members,show-inheritance,ignore-module-all"
apidoc_modules = [
    {
        "path": str(_ROOT / package),
        "destination": f"docs/reference/{package}",
        "exclude_patterns": [
            str(_ROOT / package / name)
            for name in ("**/kernels", "**/kernels/*", "cli", "cli/*", "__main__.py")
        ],
        "separate_modules": False,  # few pages: each carries the list of all, which costs
        "module_first": True,
    }
    for package in _PACKAGES
]
exclude_patterns = ["docs/reference/*/modules.rst"]

_GUIDE = [
    "guide",
    "recordings",
    "calibration",
    "checking",
    "viewing",
    "exports",
    "python",
    "results",
]
_PROJECT = ["docs/architecture", "docs/papers", "CONTRIBUTING", "CHANGELOG"]
_OTHERS = sorted(
    {path.stem for path in (_ROOT / "docs").glob("*.md")} - {*_GUIDE, "architecture", "papers"}
)


def _list(caption: str, pages: list[str]) -> str:
    return "\n".join(
        ["", "```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""]
    )


def _add_pages(app: Sphinx, page: str, source: list[str]) -> None:
    """Adds the list of pages to the front page: the README, which needs none on GitHub."""
    if page == root_doc:
        source[0] += _list("User guide", [f"docs/{name}" for name in (*_GUIDE, *_OTHERS)])
        source[0] += _list(
            "Reference",
            ["docs/names", *(f"docs/reference/{package}/{package}" for package in _PACKAGES)],
        )
        source[0] += _list("The project", _PROJECT)


def _keep_bars(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Keeps |A| in docstrings, a size or an absolute value, from being read as a substitution; what
    stands in backticks is left alone.
    """
    lines[:] = [re.sub(r"(`[^`]*`)|\|", lambda found: found[1] or r"\|", line) for line in lines]


def setup(app: Sphinx) -> None:
    """Connects what is above."""
    app.connect("autodoc-process-docstring", _keep_bars)
    app.connect("source-read", _add_pages)
