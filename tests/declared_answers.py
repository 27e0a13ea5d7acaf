"""Every answer that a command gives in a test is what the command declares."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import typer._click.globals

from toolkit.cli import console

_print, _stream = console.answer, console.stream


def hold_to_declarations() -> None:
    """Hold what commands answer from now on to what they declare; before their modules are imported."""
    console.answer, console.stream = _answer, _answer_in_parts


def _answer(payload: Mapping[str, Any], text: str, *, as_json: bool, quiet: bool) -> None:
    _check(payload, whole=as_json)
    _print(payload, text, as_json=as_json, quiet=quiet)


def _answer_in_parts(payload: dict[str, Any]) -> None:
    lists = {key: list(value) for key, value in payload.items() if isinstance(value, Iterator)}
    _check(payload | lists, whole=True)
    _stream(payload | {key: iter(value) for key, value in lists.items()})


def _check(payload: Mapping[str, Any], *, whole: bool) -> None:
    """Refuse an answer that departs; one that is printed for people may lack keys."""
    from toolkit.cli.groups import declared_type
    from toolkit.declared import json_value
    from toolkit.declared.answers import departures

    context = typer._click.globals.get_current_context(silent=True)
    declared = None if context is None else getattr(context.command.callback, "answer", None)
    if context is None and "requested" in payload:  # a request is answered after its command has ended
        declared = "toolkit.lab.signatures.signing:RequestedAnswer"
    if declared is not None:
        document = {key: value for key, value in json_value(payload).items() if key != "schema"}
        departs = [
            fault
            for fault in departures(document, declared_type(declared))
            if whole or not fault.endswith(": missing")
        ]
        assert not departs, departs
