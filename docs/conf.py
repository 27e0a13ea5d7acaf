"""How Sphinx makes the site of ``docs/`` and the pages beside it: ``make docs``, without a network.

The pages stand where a reader of the source meets them. The contents of the site are the links of
``docs/README.md`` (and of the page of decisions), by heading: no second list is kept.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from toolkit.version import __version__  # noqa: E402  found by the path above

project = "toolkit"
copyright = "its contributors, MIT licence"  # noqa: A001  Sphinx's own name
version = release = __version__
extensions = ["myst_parser"]
root_doc = "docs/README"
include_patterns = ["*.md", "docs/**.md"]
exclude_patterns = [
    ".*", "benchmarks", "build", "calibrations", "demo-out", "dist", "proof", "report_templates", "tests",
    "toolkit",
]  # fmt: skip
myst_heading_anchors = 4
myst_links_external_new_tab = False
suppress_warnings = ["misc.highlighting_failure", "myst.header"]
pygments_style = "default"

html_theme = "furo"
html_title = f"toolkit {release}"
html_show_sourcelink = html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None


def contents(page: str, text: str) -> str:
    """Return the hidden tables of contents of a page: the pages that it links to, by heading."""
    folder = Path(page).parent
    tables = []
    for section in re.split(r"(?m)^## ", text)[1:] or [text]:
        links = dict.fromkeys(re.findall(r"\]\(([^)#:\s]+)\.md\)", section))
        title = section.partition("\n")[0] if section is not text else ""
        caption = f":caption: {title}\n" if title else ""
        if links:
            entries = "\n".join(_relative(folder, link) for link in links)
            tables.append(f"```{{toctree}}\n:hidden:\n{caption}\n{entries}\n```\n")
    return "\n".join(tables)


def _relative(folder: Path, link: str) -> str:
    parts: list[str] = []
    for part in (*folder.parts, *Path(link).parts):
        if part == "..":
            parts.pop()
        else:
            parts.append(part)
    return "/" + "/".join(parts)


def _with_contents(_app: Any, page: str, source: list[str]) -> None:
    if page in {root_doc, "docs/decisions/README"}:
        source[0] += "\n" + contents(page, source[0])


def setup(app: Any) -> None:
    """Add the contents to the pages that list others."""
    app.connect("source-read", _with_contents)
