"""The site in a wheel: made from the pages when a wheel is built, packed as ``toolkit/_site``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


def make_site(root: Path) -> Path:
    """Make the site of a checkout and return its folder; a warning of Sphinx's ends it."""
    site = root / "build" / "docs"
    # -E: pages of an earlier build say nothing about those of today.
    words = [
        "-q",
        "-E",
        "-W",
        "--keep-going",
        "-b",
        "html",
        "-c",
        "docs",
        "-d",
        "build/doctrees",
        ".",
        str(site),
    ]
    subprocess.run([sys.executable, "-m", "sphinx", *words], cwd=root, check=True)
    return site


class SiteHook(BuildHookInterface):  # type: ignore[type-arg]
    """Puts the site into a wheel; an editable installation reads the checkout's own."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the site and name its folder to the builder."""
        if version != "editable":
            build_data["force_include"][str(make_site(Path(self.root)))] = "toolkit/_site"


if __name__ == "__main__":
    print(make_site(Path(__file__).resolve().parents[1]) / "docs" / "README.html")  # noqa: T201
