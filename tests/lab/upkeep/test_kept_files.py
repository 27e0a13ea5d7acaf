"""Kinds of files: the steps of one are a chain from version to version; what is shipped is known."""

from __future__ import annotations

import tomllib
from pathlib import Path

from toolkit.lab.home import TEMPLATES, packaged_home
from toolkit.lab.upkeep.kept_files import Kind, _release, _todays_digests, kinds


def number(_name: str, data: bytes) -> int:
    return int(data.split(b":")[0])


def test_steps_lead_from_version_to_version_and_a_version_without_one_is_read_as_it_is() -> None:
    chain = Kind(
        title="chain",
        names=("*.x",),
        read=lambda _path: None,
        version=number,
        newest=4,
        steps={
            1: lambda _name, data: b"2:" + data[2:] + b"!",
            2: lambda _name, data: b"3:" + data[2:] + b"?",
        },
    )
    assert chain.converted("a.x", b"1:text") == (b"3:text!?", (1, 2))
    assert chain.converted("a.x", b"3:text") == (b"3:text", ())


def test_a_step_that_changes_no_version_ends_the_chain() -> None:
    still = Kind(
        title="still", names=("*",), read=lambda _path: None, version=number,
        steps={1: lambda _name, data: data},
    )  # fmt: skip
    assert still.converted("a", b"1:") == (b"1:", (1,))


def test_evidence_has_no_steps() -> None:
    assert {kind.title for kind in kinds() if kind.steps} == {"template", "style file"}


def test_what_a_release_shipped_is_shipped_today_too_or_has_a_step() -> None:
    table = Path(str(packaged_home())) / "toolkit" / "lab" / "upkeep" / "shipped_templates.toml"
    releases = tomllib.loads(table.read_text())
    today = {path.name for path in (packaged_home() / TEMPLATES).iterdir()}
    assert {name for files in releases.values() for name in files} <= today
    assert all(_release(path.name, path.read_bytes()) for path in (packaged_home() / TEMPLATES).iterdir())
    assert len(_todays_digests()) == len(today)
