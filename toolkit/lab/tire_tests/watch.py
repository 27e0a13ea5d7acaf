"""A watch of a folder: its watcher with the reports that it makes, the lock of its output, its answer."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, TypedDict

from toolkit.lab.tire_tests.reports import MadeReport, NamedRefusal, NamedReport, Options
from toolkit.lab.tire_tests.resolve import Resolved
from toolkit.lab.tire_tests.watching import Aside, Round, Waiting, Watcher


class WatchAnswer(TypedDict):
    """What a watch made, and what waits at its end."""

    made: list[NamedReport | NamedRefusal]
    waiting: list[Waiting]
    set_aside: list[Aside]
    attention: Annotated[int, "reports that a person should look at"]


def watcher_of(
    folder: Path,
    out: Path,
    options: Options,
    *,
    settle_s: float,
    patience_s: float,
    units: str | None,
    calibrations: Path | None,
    home: Path | None,
) -> Watcher:
    """Return the watcher that makes reports with these options; the state in ``out`` goes on."""
    return Watcher(
        folder,
        out,
        resolve=options.resolve,
        report=partial(_report, options, out),
        settle_s=settle_s,
        patience_s=patience_s,
        clock=time.monotonic,
        settings=_settings(options, units),
        registry=partial(_registry, calibrations, home),
    )


class WatchLog:
    """What was said of the looks so far: a watch runs for months, so no look and no report is kept whole."""

    def __init__(self, *, keep: bool) -> None:
        """Keep the answer of every report made, for ``--json``; else their number alone."""
        self.keep = keep
        self.made: list[NamedReport | NamedRefusal] = []
        self.attention = 0
        self.last: Round | None = None

    def add(self, look: Round, say: Callable[[str], None]) -> None:
        """Say what is new in a look."""
        from toolkit.lab.tire_tests.reports import attention, named_payload
        from toolkit.listing import one_line

        for report in look.made:
            self.attention += attention(report)
            if self.keep:
                self.made.append(named_payload(report))
            if not isinstance(report.outcome, Exception):
                say(one_line(f"{report.test}: {report.outcome.pdf}, {report.outcome.pages} pages"))
        before = self.last or Round(made=(), waiting=(), set_aside=())
        for fault in look.set_aside:
            if fault not in before.set_aside:
                reason = fault.reason.partition("\n")[0]
                say(one_line(f"{fault.test}: set aside, {fault.rule}: {reason}"))
        for waits in look.waiting:
            if waits not in before.waiting:
                say(one_line(f"{waits.test}: waiting, {waits.reason}"))
        self.last = replace(look, made=())

    def payload(self) -> WatchAnswer:
        """Return the answer: what was made, and what waits or stands aside at the end."""
        waiting, aside = (self.last.waiting, self.last.set_aside) if self.last else ((), ())
        return {
            "made": self.made,
            "waiting": list(waiting),
            "set_aside": list(aside),
            "attention": self.attention,
        }


@contextlib.contextmanager
def alone(out: Path) -> Iterator[None]:
    """Hold the output folder for one watch."""
    from toolkit.errors import OutputError
    from toolkit.inputs import open_regular_to_append
    from toolkit.system import lock_file

    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = open_regular_to_append(out / ".watch.lock")
    except OSError as error:
        raise OutputError(
            "the output folder cannot be written", where=out, got=error.strerror,
            expected="a writable folder", next_step="choose another folder with --out", rule="not-writable",
        ) from error  # fmt: skip
    with lock:
        try:
            lock_file(lock.fileno())
        except OSError as error:
            raise OutputError(
                "another watch works into this folder", where=out, got="a lock that is held",
                expected="one watch for each output folder",
                next_step="end the other one, or choose another --out", rule="watch-running",
            ) from error  # fmt: skip
        yield


def _registry(calibrations: Path | None, home: Path | None) -> str:
    """Return one hash of every ledger's head, and of the day: what is in force can change with either."""
    from toolkit.calibration.registry.registry import today
    from toolkit.files import sha256_bytes
    from toolkit.lab.home import open_registry

    registry = open_registry(calibrations, home)
    heads = [f"{name} {registry.head(name)}" for name in registry.instruments()]
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
) -> list[MadeReport]:
    """Make the reports of tests that were read already, each in its folder."""
    from toolkit.errors import ToolkitError
    from toolkit.lab.tire_tests.reports import MadeReport, make_reports
    from toolkit.report.drawer import Drawer
    from toolkit.report.word.office import Office

    tests = list(resolved)
    options = replace(options, resolve=resolved.__getitem__)
    with Office() as office, Drawer() as drawer:
        try:
            return make_reports(tests, options, out, folders=folders, office=office, drawer=drawer)
        except ToolkitError as error:
            # One alone raises its error.
            return [MadeReport(test=tests[0], resolved=resolved[tests[0]], outcome=error)]
