"""Every path that a command takes, led to where nothing can be read or written: refused by its name.

Commands and their paths are those of the command line itself: one that has no words here fails.
"""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest

from tests.cli.test_sign import keygen
from tests.conftest import EXAMPLES
from tests.fuzz.corpus import _model
from toolkit.cli.main import command_tree, run
from toolkit.inputs import raise_limits
from toolkit.lab.home import packaged_home
from toolkit.report.word import tag_sheet

RECORD = "m15-virtual-r1"
DECIDED = "--reason x --by anna"
LINES = {
    "demo": "--out out",
    "init": "out",
    "doctor": "",
    "docs": "--no-browser",
    "inspect": "test --machine m15.toml",
    "calibrate": "session/SESSION.toml --machine m15.toml",
    "process": "test --out out.xlsx --protocol protocol.toml",
    "fit": "table.csv --tir out.tir --model mf61",
    "evaluate": "tire.tir table.csv --out out.csv",
    "convert": "table.csv out.tdx",
    "compare": "test.xlsx other.xlsx --out out --template report_templates/comparison.docx",
    "report": "test.xlsx --out out --template report_templates/org.docx --details empty.toml",
    "watch": "inbox --once --settle 0 --patience 0 --out out --template report_templates/org.docx",
    "sign": "request.json --key ../keys/anna --out out.json --yes",
    "audit": "inbox --out out --reports reports.csv --parquet out.parquet --workers 1",
    "simulate": "test_plan.toml --out out",
    "diagnose": "case/CASE.toml --out out",
    "verify": "calibrations/m15/m15-r2.json",
    "explain": "",
    "qualify": "--out out",
    "migrate": ". --dry-run",
    "open": ". --no-browser --port 0 --certificate tire.tir --key tire.tir",
    "calibration list": "",
    "calibration show": RECORD,
    "calibration verify": "",
    "calibration history": RECORD,
    "calibration import": "calibrations/m15/m15-r1.source.toml",
    "calibration approve": f"{RECORD} --in-force-from 2026-04-01 --checked-by anna "
    "--machine m15-virtual.toml",
    "calibration withdraw": f"{RECORD} --on 2026-04-01 {DECIDED}",
    "calibration certificate": f"{RECORD} --out out --template report_templates/certificate.docx",
    "calibration budget": f"{RECORD} --figure out.png",
    "calibration diff": f"{RECORD} {RECORD}",
    "calibration discard": f"{RECORD} {DECIDED}",
    "calibration report": RECORD,
    "calibration standard": f"{RECORD} --standard e74",
    "calibration apply": f"{RECORD} applied.csv --out out.csv",
    "calibration chart": "m15-virtual --out out.png",
    "calibration due": "",
    "template check": "report_templates/org.docx",
    "template tags": "--template report_templates/org.docx",
    "template new": "out.docx",
    "template words": "--template report_templates/org.docx",
    "machine show": "m15.toml",
    "machine new": "out.toml",
    "session new": "out.toml",
    "test new": "out.toml",
    "case new": "out.toml",
    "plan new": "out.toml",
    "plan session": "m15-virtual --out out --loads 20",
    "plan interval": "m15-virtual",
    "plan test": "--out out --minutes 1",
    "plan next": "answer.json --out out",
    "machine correct": "case/model.toml --effect quadratic_drag --reason x --by anna --out out.toml "
    "--machine m15.toml",
    "person key": "../keys/out",
    "person enrol": "dora --name Dora --role checker --key ../keys/anna.pub",
    "person list": "",
    "person revoke": "anna --from 2027-01-01T00:00:00Z --reason lost",
    "person policy": "withdraw --role head --reason x",
    "ledger prove": "m15",
    "ledger check": "--against proof.json",
    "ledger witness": "m15 out --name north --key ../keys/anna",
}
"""Words with which a command is whole; a path that is missing in them is added by its option."""
OTHER_LINES = {
    ("simulate", "inputs"): "case/model.toml --out out",
    ("compare", "laboratories"): "",
}
WRITTEN = {
    "out", "figures", "figure", "tir", "fmu", "csv", "case", "repair", "parquet", "request", "target",
    "init folder", "template new file", "person key file", "ledger witness folder",
    *(f"{kind} new file" for kind in ("machine", "session", "test", "case", "plan")),
}  # fmt: skip
NOWHERE = ("pipe", "device", "socket", "loop", "closed", "huge", "below", "nul", "long")
"""What is refused. An empty file and a folder may be what a command takes; they only end in no traceback."""


def commands(command: Any = None, *names: str) -> Iterator[tuple[str, Any]]:
    """Every command of the command line, with its words."""
    command = command_tree() if command is None else command
    if hasattr(command, "commands"):
        for name, below in command.commands.items():
            yield from commands(below, *names, name)
    else:
        yield " ".join(names), command


def _is_path(parameter: Any) -> bool:
    kinds = [parameter.type_descriptor.annotation]
    for kind in kinds:
        kinds += get_args(kind)
    return Path in kinds or parameter.name == "machine"  # which is a name, or a path


PATHS = [
    (name, parameter) for name, command in commands() for parameter in command.params if _is_path(parameter)
]


def _words(name: str, parameter: Any, place: str) -> tuple[list[str], Path]:
    """The words of a command of which one path leads to a place; the place, with the ending of that path."""
    words = OTHER_LINES.get((name, parameter.name), LINES[name]).split()
    if parameter.param_type_name == "option" and parameter.opts[0] not in words:
        return [*name.split(), *words, parameter.opts[0], place], Path(place)
    at = (
        words.index(parameter.opts[0]) + 1
        if parameter.param_type_name == "option"
        else [p.name for p in dict(commands())[name].params if p.param_type_name == "argument"].index(
            parameter.name
        )
    )
    words[at] = place + Path(words[at]).suffix
    return [*name.split(), *words], Path(words[at])


def test_every_command_has_its_words() -> None:
    assert {name for name, _ in commands()} == LINES.keys()
    assert len(PATHS) > 150


class Waiting(Exception):  # noqa: N818  no error of the command's
    """A command waits."""


def _hang(*_: object) -> None:
    raise Waiting


def _code(words: list[str]) -> object:
    """Run a command in this process, which an alarm ends where it waits; return its code."""
    before = signal.signal(signal.SIGALRM, _hang)
    signal.alarm(120)
    try:
        with pytest.raises(SystemExit) as ended:
            run(words)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        raise_limits(0)
    return ended.value.code


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A laboratory's home with an input for each command; beside it keys, and a home with people."""
    root = tmp_path_factory.mktemp("paths")
    home, signed = root / "home", root / "signed"
    for name in ("calibrations", "report_templates"):
        shutil.copytree(packaged_home() / name, home / name)
    shutil.copytree(home / "calibrations", signed / "calibrations")
    (root / "keys").mkdir()
    for name in ("anna", "ben"):
        keygen(root / "keys" / name)
    plan = (EXAMPLES / "virtual" / "test_plan.toml").read_text()
    (home / "test_plan.toml").write_text(plan.replace("rows_per_revolution = 100", "rows_per_revolution = 4"))
    for path in (EXAMPLES / "virtual" / "session_plan.toml", EXAMPLES / "virtual" / "tire.tir"):
        shutil.copy(path, home)
    for path in (EXAMPLES.parent / "machine").glob("*.toml"):
        shutil.copy(path, home)
    for name in ("inbox", "case"):
        (home / name).mkdir()
    for name, data in _model().items():
        (home / "case" / name).write_bytes(data)
    (home / "empty.toml").touch()
    (home / "reports.csv").write_text("report,test\nA,B\n")
    (home / "applied.csv").write_text("D51 [mV/V],D52 [mV/V],E5 [mV/V]\n0.1,0.1,0.1\n")
    with contextlib.chdir(home):
        for words in (
            "simulate session_plan.toml --out session",
            "simulate test_plan.toml --out test",
            "process test --out test.xlsx",
            "process test --out other.xlsx",
            "convert test.xlsx table.csv",
            f"person enrol anna --name Anna --role head --key ../keys/anna.pub --sign ../keys/anna "
            f"--recovery ../keys/ben --home {signed}",
            f"calibration withdraw {RECORD} --on 2026-04-01 {DECIDED} --request request.json --home {signed}",
        ):
            assert _code([*words.split(), "--quiet"]) in (0, 1), words
    return home


@pytest.fixture
def sheet(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sheet of tags for all places where it cannot be written: it takes a second each time."""
    write, sheets = tag_sheet.tag_sheet, []

    def written(*given: Any, **named: Any) -> bytes:
        if not sheets:
            sheets.append(write(*given, **named))
        return sheets[0]

    monkeypatch.setattr(tag_sheet, "tag_sheet", written)


def _put(kind: str, place: Path) -> None:
    if kind in ("below", "nul", "long"):
        return
    with contextlib.suppress(FileNotFoundError):
        place.rmdir() if place.is_dir() else place.unlink()
    match kind:
        case "pipe":
            os.mkfifo(place)
        case "device":
            place.symlink_to("/dev/zero")
        case "socket":
            with socket.socket(socket.AF_UNIX) as listener:
                listener.bind(str(place))
        case "loop":
            place.symlink_to(place.name)
        case "closed":
            place.write_text("x")
            place.chmod(0)
        case "huge":
            with place.open("wb") as stream:
                stream.truncate(1 << 42)
        case "empty":
            place.touch()
        case "folder":
            place.mkdir()


@pytest.mark.parametrize(
    ("name", "parameter"), PATHS, ids=[f"{name} {parameter.opts[0]}" for name, parameter in PATHS]
)
def test_a_path_to_nowhere_is_refused_by_its_name(
    home: Path,
    sheet: None,
    name: str,
    parameter: Any,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(home)
    if name in ("report", "watch") and shutil.which("soffice") is None:
        pytest.skip("LibreOffice is started before anything is read, and is not installed")
    is_output = bool({parameter.name, f"{name} {parameter.name}"} & WRITTEN)
    wrong = []
    for kind in (*NOWHERE, "empty", "folder"):
        if is_output and kind in ("closed", "huge", "empty", "folder"):
            continue  # a file or a folder that is replaced
        if kind == "closed" and os.geteuid() == 0:
            continue  # nothing is closed to root
        if kind == "folder" and parameter.name in ("home", "calibrations"):
            continue  # an empty registry is one
        if kind in ("empty", "folder"):
            monkeypatch.setenv("PATH", "/nowhere")  # no LibreOffice: what is accepted is not worked out
        stem = {"below": "tire.tir/below", "nul": "nul\0", "long": "n" * 300}.get(kind, f"to-{kind}")
        words, place = _words(name, parameter, stem)
        _put(kind, place)
        monkeypatch.setattr("sys.stdin", io.StringIO("a passphrase\n"))
        code, printed = _code(words), "".join(capsys.readouterr())
        named = any(text in printed for text in (stem.rstrip("\0"), str(Path(stem).parent) + "\n"))
        refused = code == 2 and named and ("next:" in printed or name == "verify")
        if not refused and not (kind in ("empty", "folder") and code in (0, 1, 2)):
            wrong.append((kind, code, printed[-300:]))
    assert wrong == []
