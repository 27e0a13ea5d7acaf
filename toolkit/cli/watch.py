"""`toolkit watch`: a report as soon as a test is whole."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import say
from toolkit.cli.options import INTO_FOLDER, AllowMissing, Output, RegistryOptions, ReportTemplate

NAME = "watch"


@answers("toolkit.lab.tire_tests.watch:WatchAnswer")
def command(
    folder: Annotated[
        Path, "Folder in which tests arrive, each with test.toml.", ARGUMENT, Mark(metavar="FOLDER")
    ],
    template: ReportTemplate = None,
    out: Annotated[
        Path | None, "Where reports and the state go; default: FOLDER/reports.", INTO_FOLDER
    ] = None,
    once: Annotated[bool, "Look until nothing more arrives, then end."] = False,
    interval: Annotated[float, "Seconds between looks.", Mark(min=0.05)] = 2.0,
    settle: Annotated[
        float, "Seconds after which an unchanged file counts as complete.", Mark(min=0.0)
    ] = 3.0,
    patience: Annotated[
        float, "Seconds without a change after which an incomplete test is judged.", Mark(min=0.0)
    ] = 900.0,
    units: Annotated[
        str | None,
        "SI or lbf: N and N*m, or lbf and lbf*ft, in the reports made from now on; those made before stay. "
        "Default: the style file's.",
    ] = None,
    allow_missing: AllowMissing = False,
    *,
    place: RegistryOptions,
    output: Output,
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
    from functools import partial

    from toolkit.errors import ConfigError
    from toolkit.lab.answers import unit_choice
    from toolkit.lab.home import home_template
    from toolkit.lab.tire_tests.reports import Options
    from toolkit.lab.tire_tests.resolve import resolve_test
    from toolkit.lab.tire_tests.watch import WatchLog, alone, watcher_of
    from toolkit.report.word.office import find_soffice
    from toolkit.report.word.package import read_template

    if not folder.is_dir():
        raise ConfigError(
            "the folder to watch does not exist", where=folder, got="no folder", expected="a folder",
            next_step="check the path", rule="no-test",
        )  # fmt: skip
    style = None if units is None else unit_choice(units)
    find_soffice()
    options = Options(
        template=read_template(template or home_template("org.docx", place.home)),
        resolve=partial(resolve_test, basis=place.basis()),
        units=style,
        allow_missing=allow_missing,
    )
    target = out or folder / "reports"
    tell = (lambda _text: None) if output.silent else say
    watched = WatchLog(keep=output.json)
    with alone(target), _stopping() as stop:
        watcher = watcher_of(
            folder, target, options, settle_s=settle, patience_s=patience, units=units,
            calibrations=place.calibrations, home=place.home,
        )  # fmt: skip
        while not stop:
            look = watcher.look()
            watched.add(look, tell)
            if once and not any(waits.reason == "files are arriving" for waits in look.waiting):
                break
            _sleep(interval, stop)
    payload = watched.payload()
    output.answer(payload, "")
    return 1 if payload["waiting"] or payload["set_aside"] or payload["attention"] else 0


@contextlib.contextmanager
def _stopping() -> Iterator[list[int]]:
    """Yield a list that is no longer empty once the command was asked to end."""
    signals: list[int] = []
    old = {
        request: signal.signal(request, lambda number, _frame: signals.append(number))
        for request in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield signals
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _sleep(seconds: float, stop: list[int]) -> None:
    end = time.monotonic() + seconds
    while not stop and (remaining := end - time.monotonic()) > 0:
        time.sleep(min(remaining, 0.2))
