"""One whole input of every format, with the command that reads it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from tests.calibration.dcc.dcc_factory import plain_dcc
from tests.diagnosis.cases import HEAD, SIMULATOR, TWO, carriage, write_case
from tests.house.pages import formats
from tests.recording import format_factory
from tests.recording.workbook_factory import workbook
from tests.trust.seal.seal_factory import authority, key, sealed_pdf
from toolkit.declared import read, starter, table_of
from toolkit.declared.declaration import form_of
from toolkit.declared.describe import _forms, _sections
from toolkit.declared.kinds import AnyKind
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.trust.seal.xml import seal_xml

ROOT = Path(__file__).resolve().parents[2]
VIRTUAL = ROOT / "toolkit" / "examples" / "virtual"
TEMPLATES = ROOT / "report_templates"


@dataclass(frozen=True, kw_only=True)
class Target:
    """A format: the files of a folder, which of them is mutated and how, and what reads it.

    ``command`` are the words of a command that runs in the folder, or a function of the folder. ``free`` are
    keys below which any key may stand, so that one more is no fault; ``sealed``: no byte of it may change.
    """

    name: str
    kind: str
    file: str
    files: Callable[[], Mapping[str, bytes]]
    command: tuple[str, ...] | Callable[[Path], object]
    free: tuple[str, ...] = ()
    sealed: bool = False

    def data(self) -> bytes:
        """Return the bytes that are mutated."""
        return self.files()[self.file]


def _folder_of(path: Path) -> dict[str, bytes]:
    return {p.relative_to(path).as_posix(): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


@cache
def _recordings() -> Mapping[str, bytes]:
    rng = np.random.default_rng(7)
    mean, scale = {"FZ": 1100.0}, {"FZ": 3.0, "SA": 0.01, "MZ": 30.0}
    table = {
        n: np.round(rng.normal(mean.get(n, 0.0), scale.get(n, 300.0), 24), 4) for n in format_factory.HEADER
    }
    files = format_factory.every(table)
    files["semicolon.csv"] = files["run.csv"].replace(b",", b";").replace(b".", b",")
    files["german.lvm"] = format_factory.lvm(table, separator=";", decimal=",", x="Multi", segments=2)
    return files | {"run.xlsx": workbook()}


def _run(*words: object) -> None:
    from toolkit.cli.main import run

    with contextlib.suppress(SystemExit):
        run([*map(str, words), "--quiet"])


def _simulated(plan: str) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        _run("simulate", VIRTUAL / plan, "--out", Path(folder) / "out")
        files = _folder_of(Path(folder) / "out")
    return {name: data for name, data in files.items() if name != "truth.json"}


@cache
def _session() -> Mapping[str, bytes]:
    return _simulated("session_plan.toml")


@cache
def _rich_session() -> Mapping[str, bytes]:
    """The session with every kind of statement that a session may hold."""
    text = _session()["SESSION.toml"].decode()
    text = text.replace(
        'zero = "tared"', 'phase = "as_left"\nmodel = "linear"\nmethod = "ols"\ndrop = []\nzero = "tared"'
    )
    text += """
[certificate]
number = "C-1"
country = "US"
decision_rule = "simple"
received = 2026-03-01

[standard]
preloads = 3

[[creep]]
load = "FY"
seconds = 30
value = { D51 = 0.001, D52 = 0.001, E5 = 0.0 }

[[polarity]]
load = "FY"
value = { value = 100, unit = "lbf" }
[polarity.indications]
D51 = { value = 0.05, unit = "mV/V" }
D52 = { value = 0.05, unit = "mV/V" }
E5 = { value = 0, unit = "mV/V" }
"""
    return {**_session(), "SESSION.toml": text.encode()}


@cache
def _test() -> Mapping[str, bytes]:
    files = _simulated("test_plan.toml")
    many = sorted(name for name in files if name.endswith(".xlsx"))[3:]
    toml = b"".join(
        line
        for line in files["test.toml"].splitlines(keepends=True)
        if not any(n.encode() in line for n in many)
    )
    return {name: data for name, data in files.items() if name not in many} | {"test.toml": toml}


@cache
def _case() -> Mapping[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        write_case(Path(folder))
        return _folder_of(Path(folder))


@cache
def _answer() -> Mapping[str, bytes]:
    from toolkit.declared import json_value
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.diagnose import diagnose

    with tempfile.TemporaryDirectory() as folder:
        runs = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
        case = read_case(write_case(Path(folder), HEAD + TWO, simulator=SIMULATOR, **runs))
        answer = {"schema": 1, **json_value(diagnose(case, None, limits=None).diagnosis), "model": None}
    return {"diagnosis.json": json.dumps(answer).encode()}


@cache
def _model() -> Mapping[str, bytes]:
    """A case on a model file: the carriage with a drag that an answer added to it."""
    files = _case()
    head, rest = files["CASE.toml"].decode().split("[simulation]")
    parameters = rest[rest.index("\n[") :]
    model = MODEL.format(case=_sha(files["CASE.toml"]), run=_sha(files["r0.csv"]), code=_sha(files["sim.py"]))
    again = f'{head}[simulation]\nmodel = "model.toml"\n{parameters}'
    return files | {"model.toml": model.encode(), "AGAIN.toml": again.encode()}


def _sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


MODEL = """schema = 1
content = "augmented simulation"
title = "A carriage"
code_version = "0.1.0"
axes = "machine"
time = "t"
nominal_load_N = 4000.0

[answer]
verdict = "named"
remaining = "nothing"
complete = true
case = "CASE.toml"
case_sha256 = "{case}"
recordings = {{ "r0.csv" = "{run}" }}

[simulation]
kind = "python"
path = "sim.py"
function = "simulate"

[simulation.sha256]
path = "{code}"

[simulation.parameters.mass]
value = 94.0
unit = "kg"
standard_error = 4.6
bounds = [80.0, 110.0]

[simulation.parameters.c]
value = 210.0
unit = "N*s/m"
standard_error = 40.0

[channels]
t = {{ unit = "s", role = "time" }}
v = {{ unit = "m/s", role = "input" }}
a = {{ unit = "m/s^2", role = "input" }}
F = {{ unit = "N", role = "output" }}

[[effect]]
name = "quadratic_drag"
stage = "dynamics"
statement = "Drag is missing: a force with the square of the velocity."
equation = "m a = ... - drag * v|v|"
channel = "F"

[effect.parameters.drag]
value = 800.0
unit = "N/(m/s)^2"
standard_error = 20.0
"""


@cache
def _audited() -> Mapping[str, bytes]:
    """A folder of recordings that was audited, with what the next run goes on from."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, data in {**REGISTRY, "archive/run.csv": _recordings()["run.csv"]}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(data)
        where = ("--calibrations", root / "calibrations", "--out", root / "out")
        _run("audit", root / "archive", *where, "--workers", 1)
        return _folder_of(root)


@cache
def _watched() -> Mapping[str, bytes]:
    """An inbox that was watched: its one test is set aside, as it has no recording."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        files = {**REGISTRY, "inbox/a/test.toml": _test()["test.toml"]}
        for name, data in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(data)
        _run("watch", root / "inbox", *WATCH, "--calibrations", root / "calibrations", "--out", root / "out")
        return _folder_of(root)


WATCH = ("--once", "--interval", "0.05", "--settle", "0", "--patience", "0")


@cache
def _sealed() -> Mapping[str, bytes]:
    """What a laboratory issued and what its standard came with, and whom the home trusts."""
    manifest = {
        "schema": 1,
        "outputs": [{"name": "sealed.pdf", "sha256": _sha(sealed_pdf())}],
        "records": [{"id": "m15-r2", "sha256": "0" * 64}],
    }
    return {
        "sealed.pdf": sealed_pdf(),
        "standard.xml": seal_xml(plain_dcc(), key()),
        "manifest.json": json.dumps(manifest).encode(),
        "trust/certificates/root.pem": authority().pem,
        **REGISTRY,
    }


def _file(path: Path, name: str = "", **beside: bytes) -> Callable[[], Mapping[str, bytes]]:
    return lambda: {
        name or path.name: path.read_bytes(),
        **{k.replace("__", "."): v for k, v in beside.items()},
    }


def _text(name: str, text: str) -> Callable[[], Mapping[str, bytes]]:
    return lambda: {name: text.encode()}


def _read_plan(folder: Path) -> object:
    from toolkit.simulation.plan import read_plan

    return read_plan(folder / "test_plan.toml")


def _read_case(folder: Path) -> object:
    from toolkit.diagnosis.case.reader import read_case

    return read_case(folder / "CASE.toml")


def _read_again(folder: Path) -> object:
    from toolkit.diagnosis.case.reader import read_case

    return read_case(folder / "AGAIN.toml")


def _read_reports(folder: Path) -> object:
    from toolkit.audit.linked import read_reports

    return read_reports(folder / "reports.csv", [])


def _read_declared(cls: type) -> Callable[[Path], object]:
    return lambda folder: read(cls, folder / "file.toml")


def _names_of_tables(cls: type) -> Iterator[str]:
    """The entries below which a file has names of its own, or anything."""
    for _, table in _sections(table_of(cls), "", set()):
        for field in table.fields:
            kinds = (kind.item if isinstance(kind, ListKind) else kind for kind in _forms(field.kind))
            if any(isinstance(kind, KeyedKind | AnyKind) for kind in kinds):
                yield field.key


def _declared(cls: type) -> Target:
    """The file of a declaration: its starter, read as the declaration reads it."""
    return Target(
        name=f"file {form_of(cls).title}",
        kind="tree",
        file="file.toml",
        files=_text("file.toml", starter(cls)),
        command=_read_declared(cls),
        free=tuple(_names_of_tables(cls)),
    )


def _read_answer(folder: Path) -> object:
    from toolkit.diagnosis.answer.reader import read_answer

    return read_answer(folder / "diagnosis.json")


@cache
def _tydex() -> Mapping[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        table, out = Path(folder) / "t.csv", Path(folder) / "t.tdx"
        table.write_text(TABLE)
        _run("convert", table, out)
        return {"t.tdx": out.read_bytes()}


TABLE = "SA [deg],FZ [N],FY [N],MZ [N*m],IA [deg]\n" + "".join(
    f"{a},{load},{-a * load / 6},{a * load / 300},0\n" for load in (2000, 4000) for a in (-4, -2, 0, 2, 4)
)
MAKER = "FZ [N],conicity [N],U_conicity [N],plysteer [N],secant_cornering [N/deg]\n" + "".join(
    f"{load},{load / 100},5,{load / 90},{load / 5}\n" for load in (2000, 4000, 6000)
)
REPORTS = "report,test,sha256\nR-1,a test,\nR-2,," + "0" * 64 + "\n"
REGISTRY = {f"calibrations/m15/{n}": d for n, d in _folder_of(ROOT / "calibrations" / "m15").items()}


def _recording(name: str, kind: str) -> Target:
    return Target(
        name=name,
        kind=kind,
        file=name,
        files=lambda: {name: _recordings()[name], **REGISTRY},
        command=("inspect", name),
    )


TARGETS = (
    Target(
        name="session",
        kind="tree",
        file="SESSION.toml",
        files=_rich_session,
        command=("calibrate", "SESSION.toml", "--out", "out"),
    ),
    Target(
        name="loads",
        kind="text",
        file="loads_simulated.csv",
        files=_session,
        command=("calibrate", "SESSION.toml", "--out", "out"),
    ),
    Target(
        name="check-loads",
        kind="text",
        file="check_simulated.csv",
        files=_session,
        command=("calibrate", "SESSION.toml", "--out", "out"),
    ),
    Target(
        name="machine",
        kind="tree",
        file="m15.toml",
        files=_file(ROOT / "toolkit/machine/m15.toml"),
        command=("machine", "show", "m15.toml"),
    ),
    Target(
        name="test",
        kind="tree",
        file="test.toml",
        files=_test,
        command=("process", ".", "--calibrations", str(ROOT / "calibrations")),
    ),
    Target(
        name="plan",
        kind="tree",
        file="test_plan.toml",
        command=_read_plan,
        files=lambda: {p.name: p.read_bytes() for p in VIRTUAL.iterdir()},
    ),
    Target(
        name="continuous-plan",
        kind="tree",
        file="test_plan.toml",
        command=_read_plan,
        files=lambda: (
            {p.name: p.read_bytes() for p in VIRTUAL.iterdir()}
            | {"test_plan.toml": (VIRTUAL / "continuous_plan.toml").read_bytes()}
        ),
    ),
    Target(
        name="session-plan",
        kind="tree",
        file="test_plan.toml",
        command=_read_plan,
        files=_file(VIRTUAL / "session_plan.toml", "test_plan.toml"),
    ),
    Target(
        name="case",
        kind="tree",
        file="CASE.toml",
        files=_case,
        command=_read_case,
        free=("parameters", "channels", "run"),
    ),
    Target(name="run", kind="text", file="r0.csv", files=_case, command=_read_case),
    Target(
        name="answer", kind="tree", file="diagnosis.json", files=_answer, command=_read_answer, free=("",)
    ),
    Target(
        name="style",
        kind="tree",
        file="org.toml",
        command=("template", "check", "org.docx"),
        files=lambda: {n: (TEMPLATES / n).read_bytes() for n in ("org.docx", "org.toml")},
        free=("words", "alt", "styles", "decimals"),
    ),
    Target(
        name="template",
        kind="zip",
        file="org.docx",
        command=("template", "check", "org.docx"),
        files=lambda: {n: (TEMPLATES / n).read_bytes() for n in ("org.docx", "org.toml")},
    ),
    Target(
        name="legacy",
        kind="tree",
        file="x.toml",
        command=("calibration", "import", "x.toml", "--calibrations", "out"),
        files=_file(ROOT / "calibrations/m15/m15-r2.source.toml", "x.toml"),
    ),
    Target(
        name="record",
        kind="tree",
        file="calibrations/m15/m15-r2.json",
        files=lambda: REGISTRY,
        sealed=True,
        command=("calibration", "verify", "--calibrations", "calibrations"),
    ),
    Target(
        name="ledger",
        kind="text",
        file="calibrations/m15/ledger.jsonl",
        files=lambda: REGISTRY,
        sealed=True,
        command=("calibration", "verify", "--calibrations", "calibrations"),
    ),
    Target(
        name="ledger-head",
        kind="tree",
        file="calibrations/m15/head.json",
        files=lambda: REGISTRY,
        sealed=True,
        command=("calibration", "verify", "--calibrations", "calibrations"),
    ),
    Target(
        name="tir",
        kind="text",
        file="tire.tir",
        files=_file(VIRTUAL / "tire.tir"),
        command=("convert", "tire.tir", "out.tir"),
    ),
    Target(
        name="tir-evaluated",
        kind="text",
        file="tire.tir",
        files=_file(VIRTUAL / "tire.tir", t__csv=TABLE.encode()),
        command=("evaluate", "tire.tir", "t.csv"),
    ),
    Target(
        name="grid",
        kind="text",
        file="t.csv",
        files=_file(VIRTUAL / "tire.tir", t__csv=TABLE.encode()),
        command=("evaluate", "tire.tir", "t.csv"),
    ),
    Target(name="tydex", kind="text", file="t.tdx", files=_tydex, command=("convert", "t.tdx", "out.csv")),
    Target(
        name="table",
        kind="text",
        file="t.csv",
        files=_text("t.csv", TABLE),
        command=("convert", "t.csv", "out.tdx"),
    ),
    Target(
        name="maker",
        kind="text",
        file="a.csv",
        files=lambda: {"a.csv": MAKER.encode(), "b.csv": MAKER.replace("0,5,", "1,5,").encode()},
        command=("compare", "a.csv", "b.csv"),
    ),
    Target(
        name="reports",
        kind="text",
        file="reports.csv",
        files=_text("reports.csv", REPORTS),
        command=_read_reports,
    ),
    Target(
        name="model",
        kind="tree",
        file="model.toml",
        files=_model,
        command=("simulate", "model.toml", "--inputs", "r0.csv", "--out", "out"),
        free=("parameters", "channels", "recordings", "sha256", "numerics"),
    ),
    Target(
        name="model-case",
        kind="tree",
        file="AGAIN.toml",
        files=_model,
        command=_read_again,
        free=("parameters", "channels", "run"),
    ),
    *(
        Target(
            name=name,
            kind="text",
            file=f"out/{name}.jsonl",
            files=_audited,
            command=("audit", "archive", "--calibrations", "calibrations", "--out", "out", "--workers", "1"),
        )
        for name in ("results", "sums")
    ),
    Target(
        name="watch-state",
        kind="tree",
        file="out/watch.json",
        files=_watched,
        command=("watch", "inbox", *WATCH, "--calibrations", "calibrations", "--out", "out"),
        free=("",),
    ),
    *(
        Target(
            name=name,
            kind=kind,
            file=name,
            files=_sealed,
            sealed=True,
            command=("verify", name, "--home", "."),
        )
        for name, kind in (("sealed.pdf", "binary"), ("standard.xml", "text"))
    ),
    Target(
        name="manifest.json",
        kind="tree",
        file="manifest.json",
        files=_sealed,
        command=("verify", "manifest.json", "--home", "."),
        free=("",),
    ),
    *map(_declared, formats()),
    *(_recording(name, "text") for name in ("run.csv", "semicolon.csv", "run.lvm", "german.lvm")),
    *(_recording(name, "binary") for name in ("run.tdms", "run.mat", "table.mat", "run.mf4", "packed.mf4")),
    _recording("run.xlsx", "zip"),
)
