"""The commands of the crash bench, and the folder that they work in."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

from tests.crash.bench import Command
from tests.diagnosis.answer.test_model_text import offset_machine
from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from tests.faults import Runner
from tests.trust.seal.authority import to_pem
from tests.trust.seal.seal_factory import authority, key

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "toolkit" / "examples" / "virtual"
_AT = " --calibrations {work}/calibrations"
_HOME = " --home {work}"
_COMPARED = "compare {work}/test.xlsx {work}/table.csv --figures {work}/figures --out {work}/out" + _HOME

QUICK = (
    Command(
        name="simulate (session)",
        first="simulate {work}/session_plan.toml --out {work}/out --seed 1",
        words="simulate {work}/session_plan.toml --out {work}/out --seed 2",
    ),
    Command(
        name="template new",
        first="template new {work}/out/ours.docx --like summary",
        words="template new {work}/out/ours.docx --force",
        others=("out/theirs.docx",),
    ),
    Command(name="init", words="init {work}/out"),
)
SLOW = (
    Command(
        name="simulate (test, CSV, case)",
        first="simulate {work}/test_plan.toml --out {work}/out --csv {work}/csv --case {work}/case --seed 1"
        + _AT,
        words="simulate {work}/test_plan.toml --out {work}/out --csv {work}/csv --case {work}/case --seed 2"
        + _AT,
        sets=("out", "csv", "case"),
    ),
    Command(
        name="calibrate",
        words="calibrate {work}/session/SESSION.toml" + _AT,
        sets=("calibrations",),
        registry=True,
        then="calibration withdraw m15-virtual-r1 --on 2026-04-01 --by A.Person --reason reference" + _AT,
    ),
    Command(
        name="calibration withdraw",
        words="calibration withdraw m15-r2 --on 2026-04-01 --by A.Person --reason reference" + _AT,
        sets=("calibrations",),
        registry=True,
    ),
    Command(
        name="calibration certificate",
        first="calibration certificate m15-virtual-r1 --out {work}/out --draft --known-at 2026-05-01" + _HOME,
        words="calibration certificate m15-virtual-r1 --out {work}/out --draft --known-at 2026-06-01" + _HOME,
    ),
    Command(
        name="calibration budget",
        first="calibration budget m15-virtual-r1 --load FY --figure {work}/out/budget.png" + _AT,
        words="calibration budget m15-virtual-r1 --load MZ --figure {work}/out/budget.png" + _AT,
    ),
    Command(
        name="process",
        first="process {work}/test --units lbf --out {work}/out/test.xlsx" + _AT,
        words="process {work}/test --out {work}/out/test.xlsx" + _AT,
    ),
    Command(
        name="fit",
        first="fit {work}/table.csv --figures {work}/out --loss robust",
        words="fit {work}/table.csv --figures {work}/out --model brush",
        others=("out/notes.txt",),
    ),
    Command(
        name="convert",
        words="convert {work}/table.csv {work}/out/table.tdx",
    ),
    Command(
        name="compare",
        first=f"{_COMPARED} --units lbf",
        words=_COMPARED,
        sets=("figures", "out"),
    ),
    Command(
        name="report",
        first="report {work}/test.xlsx --out {work}/out --units lbf" + _HOME,
        words="report {work}/test.xlsx --out {work}/out --xlsx" + _HOME,
    ),
    Command(
        name="report (among other files)",
        first="report {work}/test.xlsx --out {work}/out --units lbf" + _HOME,
        words="report {work}/test.xlsx --out {work}/out --tydex" + _HOME,
        others=("out/notes.txt",),
    ),
    Command(
        name="diagnose",
        first="diagnose {work}/clean/CASE.toml --out {work}/out",
        words="diagnose {work}/drag/CASE.toml --out {work}/out",
    ),
    Command(
        name="machine correct",
        words="machine correct {work}/answer --effect steer_offset --by A --reason B --out {work}/out/2.toml",
        once=True,
    ),
    Command(
        name="audit --repair",
        first="audit {work}/test --out {work}/out --known-at 2026-05-01 --repair {work}/fixed" + _AT,
        words="audit {work}/test --out {work}/out --known-at 2026-06-01 --repair {work}/fixed" + _AT,
        sets=("out", "fixed"),
    ),
)

_KEY = "{work}/../keys"
_WITHDRAWAL = (
    "calibration withdraw m15-virtual-r1 --on 2026-11-21 --by anna --reason reference --calibrations "
    "{work}/signed/calibrations"
)


def _enrol(name: str, role: str, home: str, more: str = "") -> str:
    return (
        f"person enrol {name} --name {name.title()} --role {role} --key {_KEY}/{name}.pub --sign {_KEY}/anna "
        f"--home {{work}}/{home} {more}"
    )


SIGNED = (
    Command(
        name="person enrol (first)",
        words=_enrol("anna", "head", "new", f"--recovery {_KEY}/ben"),
        sets=("new",), registry=True, home="new",
        then=_enrol("dora", "checker", "new"),
    ),
    Command(
        name="person enrol", words=_enrol("dora", "checker", "signed"),
        sets=("signed",), registry=True, home="signed",
        then=_enrol("carl", "operator", "signed"),
    ),
    Command(
        name="person revoke",
        words=f"person revoke recovery --from 2027-01-01T00:00:00Z --reason lost --sign {_KEY}/anna "
        "--home {work}/signed",
        sets=("signed",), registry=True, home="signed",
        then=_enrol("carl", "operator", "signed"),
    ),
    Command(
        name="calibration withdraw (signed)", words=f"{_WITHDRAWAL} --sign {_KEY}/anna",
        sets=("signed",), registry=True, home="signed",
    ),
    Command(
        name="calibration withdraw (answered)", words=f"{_WITHDRAWAL} --answer {{work}}/r.anna.json",
        sets=("signed",), registry=True, home="signed",
    ),
    Command(
        name="calibration withdraw (requested)", words=f"{_WITHDRAWAL} --request {{work}}/out/r.json",
        sets=("out",), registry=True, home="signed",
    ),
    Command(
        name="sign", once=True,
        words=f"sign {{work}}/r.json --key {_KEY}/anna --yes --out {{work}}/out/r.json",
    ),
)  # fmt: skip

_SIGNED = " --calibrations {work}/signed/calibrations"
_CERTIFICATE = (
    "CC-m15-virtual-r1-"
    + json.loads((ROOT / "calibrations/m15-virtual/m15-virtual-r1.json").read_text())["sha256"][:8].upper()
)
_ISSUE = (
    f"calibration certificate m15-virtual-r1 --dcc --seal {_KEY}/seal.pem --sign {_KEY}/anna "
    "--home {work}/signed --out {work}/out"
)

SIGNED_SLOW = (
    Command(
        name="calibrate (signed)", words=f"calibrate {{work}}/next/SESSION.toml --sign {_KEY}/emil{_SIGNED}",
        sets=("signed",), registry=True, home="signed", then=f"{_WITHDRAWAL} --sign {_KEY}/anna",
    ),
    Command(
        name="calibration approve (signed)",
        words="calibration approve m15-virtual-r2 --in-force-from 2026-03-02 --checked-by finn "
        f"--sign {_KEY}/finn{_SIGNED}",
        sets=("signed",), registry=True, home="signed", then=f"{_WITHDRAWAL} --sign {_KEY}/anna",
    ),
    Command(
        name="calibration discard (signed)",
        words=f"calibration discard m15-virtual-r2 --by finn --reason slip --sign {_KEY}/finn{_SIGNED}",
        sets=("signed",), registry=True, home="signed", then=f"{_WITHDRAWAL} --sign {_KEY}/anna",
    ),
    Command(
        name="calibration certificate (issued)", words=_ISSUE,
        sets=("out", "signed"), registry=True, home="signed", then=f"{_WITHDRAWAL} --sign {_KEY}/anna",
        proved=tuple(f"out/{_CERTIFICATE}.{kind}" for kind in ("pdf", "xml", "docx")),
    ),
    Command(
        name="calibration certificate (requested)",
        words=f"{_ISSUE} --request {{work}}/asked/issue.json --issued-by anna".replace(
            f" --sign {_KEY}/anna", ""
        ),
        sets=("asked", "signed"), registry=True, home="signed",
        then=f"{_WITHDRAWAL} --sign {_KEY}/anna",
    ),
)  # fmt: skip

# LibreOffice takes seconds and is not what is killed here: a conversion of before is taken again.
_OFFICE = """#!{python}
import hashlib, os, shutil, subprocess, sys, zipfile
from pathlib import Path

if "--convert-to" not in sys.argv:
    sys.exit(0)
out = Path(sys.argv[sys.argv.index("--outdir") + 1])
for source in map(Path, sys.argv[sys.argv.index("--outdir") + 2:]):
    with zipfile.ZipFile(source) as archive:
        parts = sorted(name for name in archive.namelist() if name.startswith("word/"))
        digest = hashlib.sha256(b"".join(archive.read(name) for name in parts)).hexdigest()
    stored = Path({store!r}) / digest
    if not stored.exists():
        subprocess.run([{office!r}, *sys.argv[1:sys.argv.index("--outdir") + 2], str(source)], check=True)
        shutil.copyfile(out / (source.stem + ".pdf"), stored)
    shutil.copyfile(stored, out / (source.stem + ".pdf"))
"""


def quick_folder(base: Path, _runner: Runner) -> None:
    """Prepare what the quick commands work on."""
    shutil.copy(EXAMPLES / "session_plan.toml", base)


def whole_folder(base: Path, runner: Runner) -> None:
    """Prepare what all commands work on: a home, a session, a test, its table, two cases and an answer."""
    quick_folder(base, runner)
    for name in ("calibrations", "report_templates"):
        shutil.copytree(ROOT / name, base / name)
    plan = (
        (EXAMPLES / "test_plan.toml")
        .read_text()
        .replace("rows_per_revolution = 100", "rows_per_revolution = 10")
    )
    (base / "test_plan.toml").write_text(plan)
    write_case(base / "clean", HEAD + TWO, **{f"r{i}__csv": carriage(seed=i, coulomb=0.0) for i in range(2)})
    drag = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    offset_machine(base / "offset")
    write_case(base / "drag", HEAD + TWO, **drag)
    for words in (
        "simulate {work}/session_plan.toml --out {work}/session --seed 7",
        "simulate {work}/test_plan.toml --out {work}/test" + _AT,
        "process {work}/test --out {work}/test.xlsx" + _AT,
        "convert {work}/test.xlsx {work}/table.csv" + _AT,
        "diagnose {work}/offset/CASE.toml --out {work}/answer",
    ):
        ended = runner.run([word.replace("{work}", str(base)) for word in words.split()], root=base)
        if ended.code not in (0, 1):
            raise RuntimeError(f"{words}: {ended.err}")


def signed_folder(base: Path, runner: Runner) -> None:
    """Prepare two homes, one in which people are enrolled, keys outside of both, a request and its answer."""
    keys = base.parent / "keys"
    keys.mkdir()
    for name in ("anna", "ben", "carl", "dora", "emil", "finn"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(keys / name)]
        subprocess.run(command, check=True)
    for home in ("signed", "new"):
        shutil.copytree(ROOT / "calibrations", base / home / "calibrations")
    shutil.copytree(ROOT / "report_templates", base / "signed" / "report_templates")
    style = '[laboratory]\nname = "Laboratory"\ncountry = "DE"\n'
    (base / "signed" / "report_templates" / "certificate.toml").write_text(style)
    (base / "signed" / "trust" / "certificates").mkdir(parents=True)
    (base / "signed" / "trust" / "certificates" / "root.pem").write_bytes(authority().pem)
    (keys / "seal.pem").write_bytes(to_pem(key()))
    shutil.copy(EXAMPLES / "session_plan.toml", base)
    for words in (
        _enrol("anna", "head", "signed", f"--recovery {_KEY}/ben"),
        _enrol("emil", "operator", "signed"),
        _enrol("finn", "checker", "signed"),
        "simulate {work}/session_plan.toml --out {work}/session --seed 7",
        "simulate {work}/session_plan.toml --out {work}/next --seed 8",
        f"calibrate {{work}}/session/SESSION.toml --sign {_KEY}/emil{_SIGNED}",
        f"{_WITHDRAWAL} --request {{work}}/r.json",
        f"sign {{work}}/r.json --key {_KEY}/anna --yes",
    ):
        ended = runner.run([word.replace("{work}", str(base)) for word in words.split()], root=base)
        if ended.code not in (0, 1):
            raise RuntimeError(f"{words}: {ended.err}")


def office(place: Path) -> Path:
    """Return a LibreOffice that converts the same document once."""
    (place / "converted").mkdir()
    program = place / "soffice"
    text = _OFFICE.format(
        python=sys.executable, store=str(place / "converted"), office=shutil.which("soffice")
    )
    program.write_text(text)
    program.chmod(0o755)
    return program
