"""`toolkit demo`: the whole path on the packaged example, each step by its own command."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict

import typer

from toolkit.cli.command import answers
from toolkit.cli.options import INTO_FOLDER, Output
from toolkit.estimate import plus_minus, round_uncertainty
from toolkit.lab.answers import Timing, counted

if TYPE_CHECKING:
    from toolkit.lab.tire_tests.resolve import Resolved


class DemoStep(TypedDict):
    """A step of the demonstration."""

    title: str
    exit_code: int
    told: Annotated[str, "its outcome"]


class DemoAnswer(TypedDict):
    """The demonstration: its steps and its files."""

    out: Path
    files: list[str]
    steps: list[DemoStep]
    report: Annotated[str, "outcome of the last step"]
    timing: Timing


NAME = "demo"

_MARK = "demo.json"

Payload = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One command of the demonstration and the sentence that tells its outcome."""

    title: str
    words: tuple[str, ...]
    told: Callable[[Payload], str]


@answers(DemoAnswer)
def command(
    context: typer.Context,
    out: Annotated[Path, "Output folder; one that an earlier demo made is replaced.", INTO_FOLDER] = Path(
        "demo-out"
    ),
    *,
    output: Output,
) -> int:
    """Run the whole path on the packaged example.

    From strain gauges to a Word and PDF report. Makes report.docx, report.pdf, test.xlsx (the whole test
    in one file), tire.tir, figures/ and certificate/, the certificate of the load cells' calibration.

    Example: toolkit demo --out demo
    """
    from toolkit.machine import load_machine
    from toolkit.machine.default import SIMULATED_MACHINE

    say = _silent if output.silent else typer.echo
    steps_run: list[Payload] = []
    with _stage(out) as stage:
        steps = _steps(stage)
        say(
            f"{load_machine(SIMULATED_MACHINE).title}: from raw strain gauges to a report, "
            f"in {len(steps) + 1} steps.\n"
        )
        for number, step in enumerate(steps, start=1):
            say(f"[{number}/{len(steps) + 1}] {step.title}")
            say(f"      $ toolkit {' '.join(_shown(step.words, stage, out))}")
            code, payload = _run(context, step.words)
            outcome = step.told(payload)
            say(f"      {outcome}\n")
            steps_run.append({"title": step.title, "exit_code": code, "told": outcome})
        say(f"[{len(steps) + 1}/{len(steps) + 1}] for other programs: a tire property file and the figures")
        resolved = _resolved(stage)
        outcome = _tire_file(resolved, stage / "tire.tir")
        figures = _figures(resolved, stage)
        certificates = sorted(path.name for path in (stage / "certificate").iterdir())
        say(f"      {outcome}\n      {counted(len(figures), 'figure')}\n")
        report = steps_run[-1]
        (stage / _MARK).write_text(
            json.dumps({"generator": "toolkit", "content": "demo", "steps": steps_run}, indent=2)
        )
    say(f"The report: {out / 'report.pdf'}  ({out / 'report.docx'})")
    say(f"The whole test in one file: {out / 'test.xlsx'}")
    say("Everything here is simulated, except Figure 4.4 in step 1.")
    say(f"Took {output.timing['seconds']:.0f} s.")
    say(f"In a browser: toolkit open {out / 'home'}")
    names = ("report.docx", "report.pdf", "test.xlsx", "tire.tir")
    payload = {
        "out": out,
        "files": [str(out / name) for name in names]
        + [str(out / "figures" / name) for name in figures]
        + [str(out / "certificate" / name) for name in certificates],
        "steps": steps_run,
        "report": report["told"],
        "timing": output.timing,
    }
    output.answer(payload, "")
    return 0


def _silent(_text: str) -> None:
    pass


@contextlib.contextmanager
def _stage(out: Path) -> Iterator[Path]:
    """Yield a fresh folder; when every step has succeeded, its files replace all that is in ``out``."""
    from toolkit.errors import OutputError
    from toolkit.publication import publication, settle
    from toolkit.staging import PASSING, result_files, supersede

    settle(out)
    if out.exists() and not (
        out.is_dir()
        and ((out / _MARK).is_file() or all(path.name.startswith(PASSING) for path in out.iterdir()))
    ):
        raise OutputError(
            "the output folder holds other files",
            where=out,
            got="a folder that no demo made",
            expected="a new or empty folder, or one of an earlier demo",
            next_step="choose another folder with --out",
            rule="not-empty",
        )
    with publication(out) as stage:
        yield stage
        for path in result_files(out):
            if not path.parts[0].startswith(PASSING):
                supersede(stage, path)


def _steps(stage: Path) -> list[Step]:
    from toolkit.examples import packaged_fig4_4
    from toolkit.lab.home import packaged_home
    from toolkit.machine.default import SIMULATED_MACHINE

    home = stage / "home"
    for name in ("calibrations", "report_templates"):
        shutil.copytree(packaged_home() / name, home / name)
    plans = Path(__file__).parents[1] / "examples" / "virtual"
    at = ("--home", str(home))
    test, reduced = str(stage / "test"), str(stage / "test.xlsx")
    return [
        Step(
            title="a real recording: which calibration computed its Fy and Mz?",
            words=("inspect", str(packaged_fig4_4()[0]), *at),
            told=_told_inspect,
        ),
        Step(
            title="a reference-load session on the virtual machine: bridge outputs in mV/V",
            words=("simulate", str(plans / "session_plan.toml"), "--out", str(stage / "session")),
            told=lambda p: f"{len(p['files'])} files in session/",
        ),
        Step(
            title="fit the load cells' calibration",
            words=("calibrate", str(stage / "session" / "SESSION.toml"), *at),
            told=_told_calibrate,
        ),
        Step(
            title="refit every record of the registry from its stored data",
            words=("calibration", "verify", *at),
            told=_told_verify,
        ),
        Step(
            title="the certificate of the calibration: ISO/IEC 17025, 7.8.2 and 7.8.4",
            words=("calibration", "certificate", f"{SIMULATED_MACHINE}-r1", "--template",
                   str(home / "report_templates" / "certificate.docx"), "--out", str(stage / "certificate"),
                   *at),
            told=_told_certificate,
        ),
        Step(
            title="a whole test on the virtual machine, drum forward and reversed",
            words=("simulate", str(plans / "test_plan.toml"), "--out", test, *at),
            told=lambda p: f"{len(p['files'])} files in test/, with a steering zero, a tare, drum run-out "
            "and an acquisition program that takes E5 with the wrong sign",
        ),
        Step(
            title="recordings to one reduced test",
            words=("process", test, "--out", reduced, *at),
            told=_told_process,
        ),
        Step(
            title="tire model: the Magic Formula at each load, no start values",
            words=("fit", reduced, *at),
            told=_told_fit,
        ),
        Step(
            title="the report in the organisation's Word template, and its verified PDF",
            words=("report", reduced, "--template", str(home / "report_templates" / "org.docx"), "--out",
                   str(stage), *at),
            told=lambda p: f"{p['pages']} pages, {len(p['figures'])} figures, {len(p['manifest'])} values, "
            f"verified: {p['verified']}",
        ),
    ]  # fmt: skip


def _shown(words: tuple[str, ...], stage: Path, out: Path) -> list[str]:
    """Return a command as the user would type it, with the paths as they will be."""
    package = str(Path(__file__).parents[1])
    return [word.replace(str(stage), str(out)).replace(package, "toolkit") for word in words]


def _run(context: typer.Context, words: tuple[str, ...]) -> tuple[int, Payload]:
    """Run another command of the same program and return its exit code and its JSON answer."""
    program: Any = context.find_root().command
    caught = io.StringIO()
    with contextlib.redirect_stdout(caught):
        code = program.main(args=[*words, "--json"], prog_name="toolkit", standalone_mode=False)
    payload: Payload = json.loads(caught.getvalue())
    return int(code or 0), payload


def _told_inspect(payload: Payload) -> str:
    file = payload["files"][0] if "files" in payload else payload
    first, calibration = file["corrected_first_row"], file["calibration"]
    words = f"{calibration['record']}" + (f", {calibration['variant']}" if calibration["variant"] else "")
    withdrawn = f", withdrawn: {calibration['withdrawn']}" if calibration["withdrawn"] else ""
    return (
        f"{calibration['grade']}: {words}{withdrawn}\n      first row: Fy {first['FY_lbf']:.2f} lbf "
        f"against {first['FY_file_lbf']:.2f} in the file"
    )


def _told_calibrate(payload: Payload) -> str:
    record, FY = payload["record"], payload["loads"]["FY"]
    state = "reproduced, already recorded" if record["existing"] else record["status"]
    E5, error = FY["coefficients"]["E5"], FY["standard_errors"]["E5"]
    return (
        f"{record['id']} ({state}): E5 in FY {plus_minus(E5, error)} {FY['unit']} per "
        f"{FY['indication_units']['E5']}, its sign sure by {abs(E5) / error:.0f} standard errors"
    )


def _told_verify(payload: Payload) -> str:
    rows = payload["records"]
    verified = sum(row["verified"] for row in rows)
    return (
        f"{sum(row['ok'] for row in rows)} of {len(rows)} records ok, {verified} of them verified from data"
    )


def _told_certificate(payload: Payload) -> str:
    loads = ", ".join(
        f"{name} {round_uncertainty(load['U'])} {load['unit']}" for name, load in payload["loads"].items()
    )
    state = "verified" if payload["verified"] else "not verified"
    return (
        f"certificate/{Path(payload['pdf']).name}: {payload['pages']} pages, {state}; U at full scale {loads}"
    )


def _told_process(payload: Payload) -> str:
    conditions = sum(entry["used"] for entry in payload["conditions"])
    findings = ", ".join(dict.fromkeys(entry["rule"] for entry in payload["findings"])) or "none"
    return f"{conditions} conditions by {payload['calibration']['id']}; findings: {findings}"


def _told_fit(payload: Payload) -> str:
    errors_by_channel = []
    for channel in ("FY", "MZ"):
        errors = [fit["error_percent"] for fit in payload["fits"] if fit["channel"] == channel]
        if errors:
            errors_by_channel.append(f"{channel} {min(errors):.2f} to {max(errors):.2f} %")
    return f"{len(payload['fits'])} curves, error {', '.join(errors_by_channel)}"


def _resolved(stage: Path) -> Resolved:
    from toolkit.lab.tire_tests.resolve import Basis, resolve_test

    return resolve_test(stage / "test.xlsx", Basis(home=stage / "home"))


def _tire_file(resolved: Resolved, path: Path) -> str:
    """Write MF 6.1 over all loads of the forward run, and tell how well it fits."""
    from toolkit.lab.tire_tests.tire_files import fit_test_tire

    tire = fit_test_tire(resolved.result.reduced)
    tire.write(path, [resolved.result.reduced.machine_title])
    errors = ", ".join(f"{channel.channel} {channel.error_percent:.2f} %" for channel in tire.fit.fits)
    return f"tire.tir: MF 6.1 over all loads, error {errors}"


def _figures(resolved: Resolved, stage: Path) -> list[str]:
    from toolkit.report.figures import draw
    from toolkit.report.style import read_style, style_file
    from toolkit.report.test.content import build_content

    style = read_style(style_file(stage / "home" / "report_templates" / "org.docx"))
    content = build_content(resolved.result, resolved.record, findings=resolved.findings, style=style)
    folder = stage / "figures"
    folder.mkdir()
    names = []
    for name, plot in content.plots.items():
        (folder / f"{name}.png").write_bytes(draw(plot).png)
        names.append(f"{name}.png")
    return names
