"""The declared answers are what the commands print: packaged registry, Figure 4.4, a virtual test.

Beside these every answer that any test asks a command for is held to its declaration
(`tests/declared_answers.py`).
"""

from __future__ import annotations

import inspect
import json
import shutil
from pathlib import Path
from typing import Any, get_args

import pytest
import typer

from tests.declared_answers import departures
from toolkit.cli.command import Command, answers
from toolkit.cli.groups import build_group, declared_answers, declared_type, leaves
from toolkit.cli.main import command_tree, run
from toolkit.cli.options import Json, Output, RegistryOptions
from toolkit.declared.answers import answer_schema, tables_of
from toolkit.lab.home import packaged_home
from toolkit.version import __version__

CALIBRATIONS = packaged_home() / "calibrations"
FIG = packaged_home() / "toolkit" / "examples" / "fig4_4" / "M15_fig4_4.xlsx"
SESSION = CALIBRATIONS / "m15-virtual" / "m15-virtual-r1.session.toml"


ANSWERS = {
    command: declared and declared_type(declared)
    for command, declared in declared_answers(command_tree()).items()
}
KINDS = {table.__name__: table for declared in ANSWERS.values() for _, table in tables_of(declared)}


def ask(capsys: pytest.CaptureFixture[str], command: str, *words: object, registry: Path) -> dict[str, Any]:
    with pytest.raises(SystemExit):
        run([*command.split(), *map(str, words), "--json", "--calibrations", str(registry)])
    printed: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert printed.pop("schema") == 1
    return printed


@pytest.fixture
def laboratory(tmp_path: Path) -> dict[str, tuple[object, ...]]:
    """The words of calls that need no more than what is packaged."""
    test = tmp_path / "test"
    test.mkdir()
    (test / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-05-31')
    shutil.copy(FIG, test / "M15_0001")
    session = tmp_path / "session"
    session.mkdir()
    text = SESSION.read_text()
    for role in ("loads", "check"):
        name = f"m15-virtual-r1.{role}.csv"
        shutil.copy(CALIBRATIONS / "m15-virtual" / name, session / name)
        text = text.replace(f'"{role}_simulated.csv"', f'"{name}"')
    (session / "SESSION.toml").write_text(text)
    return {
        "inspect": (FIG, "--prove"),
        "calibrate": (session / "SESSION.toml", "--dry-run", "--full"),
        "calibration list": ("--all",),
        "calibration show": ("m15-virtual-r1",),
        "calibration history": ("m15",),
        "calibration report": ("m15-virtual-r1",),
        "calibration verify": (),
        "calibration budget": ("m15-virtual-r1", "--monte-carlo", "10000"),
        "calibration diff": ("m15-r1", "m15-r2"),
        "calibration due": (),
        "process": (test,),
    }


def test_every_command_declares_its_answer() -> None:
    assert not [command for command, declared in ANSWERS.items() if declared is None]
    assert {name for name, _ in leaves(command_tree())} == set(ANSWERS)


def test_a_command_without_a_declared_answer_is_found() -> None:
    app = typer.Typer()

    @app.command()
    def axes(json: Json = False) -> int:
        return int(json)

    @app.command()
    @answers(dict)
    def signs(json: Json = False) -> int:
        return int(json)

    assert declared_answers(build_group(app, lambda _: None)) == {"axes": None, "signs": dict}


@pytest.mark.parametrize("command", list(ANSWERS))
def test_every_kind_of_entry_says_what_it_is_and_has_a_name_of_its_own(command: str) -> None:
    for _, table in tables_of(ANSWERS[command]):
        assert KINDS[table.__name__] is table
        assert "." in (table.__doc__ or ""), table
    assert set(answer_schema(ANSWERS[command])["$defs"]) <= set(KINDS)


@pytest.mark.parametrize(
    "command",
    [
        "inspect", "calibrate", "calibration list", "calibration show", "calibration history",
        "calibration report", "calibration verify", "calibration budget", "calibration diff",
        "calibration due", "process",
    ],
)  # fmt: skip
def test_what_a_command_prints_is_what_is_declared(
    laboratory: dict[str, tuple[object, ...]], capsys: pytest.CaptureFixture[str], command: str
) -> None:
    printed = ask(capsys, command, *laboratory[command], registry=CALIBRATIONS)
    if command == "inspect":
        # Of one file its entries stand at the top too.
        assert printed["files"][0].items() <= printed.items()
    assert not list(departures(printed, ANSWERS[command]))


def test_fit_and_compare_print_what_is_declared(
    virtual_test: Path, virtual_repeat: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command, words in (
        ("fit", (virtual_test, "--model", "magic_formula", "--model", "tmeasy")),
        ("compare", (virtual_test, virtual_repeat)),
        ("process", (virtual_test,)),
    ):
        printed = ask(capsys, command, *words, registry=CALIBRATIONS)
        assert not list(departures(printed, ANSWERS[command])), command


def test_the_schema_of_an_answer_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        run(["explain", "--answer", "calibration list"])
    schema = json.loads(capsys.readouterr().out)
    assert caught.value.code == 0
    assert schema["$defs"]["Head"]["required"] == ["count", "sha256", "damage"]
    assert schema["required"] == ["schema", "records", "heads", "hidden"]
    assert schema["properties"]["records"]["items"]["anyOf"] == [
        {"$ref": "#/$defs/RecordRow"},
        {"$ref": "#/$defs/RefusedRow"},
    ]


def test_an_answer_that_is_not_declared_is_refused_with_those_that_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as caught:
        run(["explain", "--answer", "calibration lst"])
    assert caught.value.code == 2
    assert "calibration list" in capsys.readouterr().err


def test_options_of_a_class_are_options_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    app = typer.Typer()
    seen: list[tuple[int, Path | None, Output]] = []

    @app.command()
    @Command
    def axes(number: int, *, place: RegistryOptions, output: Output) -> int:
        seen.append((number, place.home, output))
        output.answer({"number": number}, "text for people")
        return 0

    command = build_group(app, lambda _: None).commands["axes"]
    assert [name for parameter in command.params for name in parameter.opts] == [
        "number", "--calibrations", "--home", "--json", "--quiet", "-q",
    ]  # fmt: skip
    command(["3", "--json"], standalone_mode=False)
    assert json.loads(capsys.readouterr().out) == {"schema": 1, "number": 3}
    command(["4", "-q"], standalone_mode=False)
    assert capsys.readouterr().out == ""
    assert seen == [(3, None, Output(json=True)), (4, None, Output(quiet=True))]


def test_every_document_of_json_has_its_schema(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["explain", "--answer", "process"], ["explain", "--answer", "evaluate"], ["--version"]):
        with pytest.raises(SystemExit) as caught:
            run([*words, "--json"])
        document = json.loads(capsys.readouterr().out)
        assert (caught.value.code, document["schema"]) == (0, 1)
    assert document == {"schema": 1, "version": __version__}


def test_every_option_of_one_value_is_refused_where_it_is_given_twice() -> None:
    """The parser takes the last one: a day or a template that was stated first would be lost unseen."""
    for words, command in leaves(command_tree()):
        for option in command.params:
            if option.param_type_name != "option" or option.is_flag or option.multiple:
                continue
            with pytest.raises(typer.BadParameter) as refusal:
                command.make_context(words, [option.opts[0], "1", option.opts[0], "2"])
            assert refusal.value.message == "one value, given once", (words, option.opts)


def test_an_empty_word_is_no_path_of_any_command() -> None:
    """A variable of the shell that is not set made a home in the working folder."""
    tried = 0
    for words, command in leaves(command_tree()):
        parameters = inspect.signature(command.callback).parameters
        for option in command.params:
            name = option.opts[0]
            kind = parameters[option.name].annotation.__origin__ if option.name in parameters else None
            if Path not in (kind, *get_args(kind)):
                continue
            with pytest.raises(typer.BadParameter) as refusal:
                command.make_context(words, [name, ""] if option.param_type_name == "option" else [""] * 9)
            assert refusal.value.message == "a path, and no empty word", (words, name)
            tried += 1
    assert tried > 150
