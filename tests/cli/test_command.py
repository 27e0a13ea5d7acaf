"""An option is the type, the text and the marks of a parameter."""

from __future__ import annotations

import inspect
import json
import pkgutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypedDict, get_args

import pytest
from typer.main import get_command_from_info
from typer.models import CommandInfo

from tests.cli.one_command import run
from tests.commands import said
from toolkit.cli.command import ARGUMENT, Mark, _mark, _word, answers
from toolkit.cli.groups import leaves
from toolkit.cli.main import command_tree
from toolkit.cli.options import INTO_FILE, Output
from toolkit.errors import OutputError, ToolkitError
from toolkit.lab.answers import Timing


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where."""

    home: Annotated[Path | None, "The home."] = None
    begun: int = field(default=0, init=False)


class WeighAnswer(TypedDict):
    """What was given."""

    load: str
    as_found: bool
    since: int
    out: Path | None
    home: Path | None
    timing: Timing


@answers(WeighAnswer)
def weigh(
    load: Annotated[str, "Which load.", ARGUMENT, Mark(metavar="LOAD")],
    as_found: Annotated[bool, "Before anything is adjusted."] = False,
    since: Annotated[int, "First row.", Mark(names=("--from", "-f")), Mark(min=1, max=9)] = 1,
    out: Annotated[Path | None, "Where it goes.", INTO_FILE] = None,
    *,
    place: Place,
    output: Output,
) -> int:
    """Weigh a load."""
    seen = {"load": load, "as_found": as_found, "since": since, "out": out, "home": place.home}
    output.answer({**seen, "timing": output.timing}, " ".join(map(str, seen.values())))
    return 0


def parts() -> dict[str, Any]:
    command = get_command_from_info(
        CommandInfo(callback=weigh), pretty_exceptions_short=False, rich_markup_mode=None
    )
    return {part.opts[0]: part for part in command.params}


def test_a_parameter_is_an_option_of_its_name_unless_a_mark_says_otherwise() -> None:
    assert list(parts()) == ["load", "--as-found", "--from", "--out", "--home", "--json", "--quiet"]


def test_marks_add_up_and_the_text_is_the_help() -> None:
    since = parts()["--from"]
    assert (since.opts, since.help) == (["--from", "-f"], "First row.")
    assert (since.min, since.max) == (1, 9)
    assert parts()["load"].metavar == "LOAD"
    assert not parts()["--as-found"].secondary_opts


def test_a_command_runs_with_what_is_given_and_takes_its_time() -> None:
    assert run(weigh, "FY", "--as-found", "-f", "3", "--home", "lab") == (0, "FY True 3 None lab\n")
    assert json.loads(run(weigh, "FY", "--json")[1])["timing"]["seconds"] > 0


def test_a_value_is_refused_before_the_command_runs(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError):
        run(weigh, "FY", "--out", tmp_path / "file" / "loads.csv")


def test_a_word_that_cannot_be_printed_is_refused_by_the_name_of_its_option() -> None:
    with pytest.raises(ToolkitError) as refused:
        run(weigh, "F\x1bY")
    assert refused.value.where == "LOAD"


def test_no_command_takes_a_number_that_is_infinite_or_none(tmp_path: Path) -> None:
    asked = set()
    for name, leaf in leaves(command_tree()):
        parameters = leaf.callback.__wrapped__._parameters
        needed = [
            "1" if "argument" in _mark(p) else f"{_word(p)}={tmp_path / 'new'}"
            for p in parameters
            if p.default is inspect.Parameter.empty and get_args(p.annotation)
        ]
        fractions = [p for p in parameters if get_args(p.annotation)[:1] in ((float,), (float | None,))]
        for option in map(_word, fractions):
            asked.add(option)
            for wrong in ("inf", "nan", "-inf", "1e999", "1e101"):
                refused = said(*name.split(), *needed, f"{option}={wrong}", "--json")
                assert refused.code == 2, (name, option, wrong)
                assert option in refused.out
    assert asked >= {"--budget", "--minutes", "--interval", "--memory", "--level"}


def test_what_refuses_a_value_is_a_function_that_there_is() -> None:
    commands = (command.callback.__wrapped__ for _, command in leaves(command_tree()))
    marks = [_mark(parameter) for command in commands for parameter in command._parameters]
    checks = {mark["check"] for mark in marks if "check" in mark}
    assert len(checks) >= 5
    assert all(map(callable, map(pkgutil.resolve_name, checks)))
