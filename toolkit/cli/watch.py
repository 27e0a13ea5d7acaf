"""`toolkit watch`: a report as soon as a test is whole."""

from __future__ import annotations

import contextlib
import fcntl
import shutil
import signal
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer
from toolkit.cli.delivery import home_template
from toolkit.cli.watching import Round

if TYPE_CHECKING:
    from toolkit.cli.report import Made, Options
    from toolkit.cli.resolve import Resolved

NAME = "watch"


def command(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder in which tests arrive, each with test.toml.")
    ],
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template; default: report_templates/org.docx of the home."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Where reports and the state go; default: FOLDER/reports.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Look until nothing more arrives, then end.")] = False,
    interval: Annotated[float, typer.Option("--interval", min=0.05, help="Seconds between looks.")] = 2.0,
    settle: Annotated[
        float, typer.Option("--settle", min=0.0, help="Files unchanged for so many seconds have arrived.")
    ] = 3.0,
    patience: Annotated[
        float,
        typer.Option(
            "--patience",
            min=0.0,
            help="Seconds without a change after which a test that is not whole is judged.",
        ),
    ] = 900.0,
    units: Annotated[
        str | None,
        typer.Option(
            "--units",
            help="SI or lbf: N and N*m, or lbf and lbf*ft, in the reports made from now on; those made "
            "before stay. Default: the style file's.",
        ),
    ] = None,
    allow_missing: Annotated[
        bool, typer.Option("--allow-missing", help="Print n/a for a value that the test has not.")
    ] = False,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Make a report as soon as the last file of a test has arrived and is whole.

    A partial file is waited for; a bad one sets its test aside, with the reason in set-aside/, and so does
    a test without a record in force: a watch makes no drafts, and tries it again once a ledger changes. A
    restart
    goes on where the last one ended; with another template, other units or another version of the toolkit it
    tries again what was refused, and leaves what was made. Ends with Ctrl-C or SIGTERM, after the report
    under way.

    Example: toolkit watch inbox --template report_templates/org.docx --out reports
    """
    from toolkit.cli.report import Options
    from toolkit.cli.resolve import resolve_test
    from toolkit.cli.units import unit_choice
    from toolkit.cli.watching import Watcher
    from toolkit.errors import ConfigError
    from toolkit.report.word.office import find_soffice
    from toolkit.report.word.package import read_template

    if not folder.is_dir():
        raise ConfigError(
            "the folder to watch does not exist", where=folder, got="no folder", expected="a folder",
            next_step="check the path", rule="no-test",
        )  # fmt: skip
    shown = None if units is None else unit_choice(units)
    find_soffice()
    resolve = partial(resolve_test, calibrations=calibrations, home=home)
    options = Options(
        template=read_template(template or home_template("org.docx", home)),
        resolve=resolve,
        units=shown,
        allow_missing=allow_missing,
    )
    target = out or folder / "reports"
    say = (lambda _text: None) if json or quiet else typer.echo
    told = _Told(keep=json)
    with _alone(target), _stopping() as stop:
        watcher = Watcher(
            folder,
            target,
            resolve=resolve,
            report=partial(_report, options, target),
            settle_s=settle,
            patience_s=patience,
            clock=time.monotonic,
            settings=_settings(options, units),
            registry=partial(_registry, calibrations, home),
        )
        while not stop:
            found = watcher.look()
            told.add(found, say)
            if once and not any(one.reason == "files are arriving" for one in found.waiting):
                break
            _sleep(interval, stop)
    payload = told.payload()
    answer(payload, "", as_json=json, quiet=quiet)
    return 1 if payload["waiting"] or payload["set_aside"] or payload["attention"] else 0


def _registry(calibrations: Path | None, home: Path | None) -> str:
    """Return one hash of every ledger's head, and of the day: what is in force can change with either."""
    from toolkit.calibration.registry.registry import Registry, today
    from toolkit.cli.home import calibrations_folder
    from toolkit.files import sha256_bytes

    registry = Registry(calibrations_folder(calibrations, home))
    heads = [f"{one} {registry.head(one)}" for one in registry.instruments()]
    return sha256_bytes("\n".join([today().isoformat(), *heads]).encode())


def _settings(options: Options, units: str | None) -> str:
    """Return one hash of what decides whether a report is refused: the template, its style, the choices."""
    from toolkit.files import sha256_bytes, sha256_file
    from toolkit.report.style import style_file

    style = style_file(options.template.path)
    parts = (options.template.sha256, sha256_file(style) if style else "", units or "", options.allow_missing)
    return sha256_bytes("\n".join(map(str, parts)).encode())


def _report(
    options: Options, out: Path, resolved: dict[Path, Resolved], folders: Sequence[Path]
) -> list[Made]:
    """Make the reports of tests that were read already, each in its folder."""
    from toolkit.cli.report import Made, make_reports
    from toolkit.errors import ToolkitError
    from toolkit.report.drawer import Drawer
    from toolkit.report.word.office import Office

    tests = list(resolved)
    own = replace(options, resolve=resolved.__getitem__)
    with Office() as office, Drawer() as drawer:
        try:
            return make_reports(tests, own, out, folders=folders, office=office, drawer=drawer)
        except ToolkitError as error:
            # One alone raises its error.
            return [Made(test=tests[0], resolved=resolved[tests[0]], outcome=error)]


class _Told:
    """What was said of the looks so far: a watch runs for months, so no look and no report is kept whole."""

    def __init__(self, *, keep: bool) -> None:
        """Keep the answer of every report made, for ``--json``; else their number alone."""
        self.keep = keep
        self.made: list[dict[str, Any]] = []
        self.attention = 0
        self.last: Round | None = None

    def add(self, found: Round, say: Any) -> None:
        """Say what is new in a look."""
        from toolkit.cli.report import report_code, report_payload

        for one in found.made:
            self.attention += report_code(one) != 0
            if self.keep:
                self.made.append({"test": one.test, **report_payload(one)})
            if not isinstance(one.outcome, Exception):
                say(f"{one.test}: {one.outcome.pdf}, {one.outcome.pages} pages")
        before = self.last or Round(made=(), waiting=(), set_aside=())
        for fault in found.set_aside:
            if fault not in before.set_aside:
                say(f"{fault.test}: set aside, {fault.rule}: {fault.reason.partition(chr(10))[0]}")
        for waits in found.waiting:
            if waits not in before.waiting:
                say(f"{waits.test}: waiting, {waits.reason}")
        self.last = replace(found, made=())

    def payload(self) -> dict[str, Any]:
        """Return the answer: what was made, and what waits or stands aside at the end."""
        waiting, aside = (self.last.waiting, self.last.set_aside) if self.last else ((), ())
        return {
            "made": self.made,
            "waiting": [{"test": one.test, "reason": one.reason} for one in waiting],
            "set_aside": [{"test": one.test, "rule": one.rule, "reason": one.reason} for one in aside],
            "attention": self.attention,
        }


@contextlib.contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Hold the output folder for one watch; what a killed one left half made is taken away."""
    from toolkit.errors import OutputError

    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = (out / ".watch.lock").open("w")
    except OSError as error:
        raise OutputError(
            "the output folder cannot be written", where=out, got=error.strerror,
            expected="a writable folder", next_step="choose another folder with --out", rule="not-writable",
        ) from error  # fmt: skip
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OutputError(
                "another watch works into this folder", where=out, got="a lock that is held",
                expected="one watch for each output folder",
                next_step="end the other one, or choose another --out", rule="watch-running",
            ) from error  # fmt: skip
        for left in [*out.glob(".report-*"), *out.glob("*/.report-*")]:
            shutil.rmtree(left, ignore_errors=True)
        yield


@contextlib.contextmanager
def _stopping() -> Iterator[list[int]]:
    """Yield a list that is no longer empty once the command was asked to end."""
    asked: list[int] = []
    old = {
        one: signal.signal(one, lambda number, _frame: asked.append(number))
        for one in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield asked
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _sleep(seconds: float, stop: list[int]) -> None:
    end = time.monotonic() + seconds
    while not stop and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, 0.2))
