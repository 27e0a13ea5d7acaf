"""What other projects wrote stands here as they published it, with its licence; it asks no other host."""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

from toolkit.workbench.app import STATIC

OWN = {"curves.js", "session.js", "vendored.toml", "work.css", "workbench.css", "workbench.js"}


def test_every_file_of_others_is_declared_with_its_hash_and_licence() -> None:
    declared = tomllib.loads((STATIC / "vendored.toml").read_text())["file"]
    assert {entry["name"] for entry in declared} | OWN == {path.name for path in STATIC.iterdir()}
    for entry in declared:
        assert hashlib.sha256((STATIC / entry["name"]).read_bytes()).hexdigest() == entry["sha256"], entry[
            "name"
        ]
        assert (STATIC / entry["licence_file"]).is_file()


def test_no_template_or_style_names_another_host() -> None:
    folder = STATIC.parent
    for path in [
        *folder.glob("templates/*.j2"),
        *(STATIC / name for name in ("session.js", "workbench.css", "workbench.js")),
    ]:
        text = path.read_text()
        assert "http:" not in text, path.name
        assert "https:" not in text, path.name
        assert " style=" not in text, path.name
        assert " onclick=" not in text, path.name


def test_all_of_it_is_in_the_wheel() -> None:
    # hatchling takes every file of the package that git does not ignore.
    ignored = (Path(__file__).resolve().parents[2] / ".gitignore").read_text().splitlines()
    assert not {"*.js", "*.css", "*.po", "*.j2", "static", "static/", "messages/"} & set(ignored)
