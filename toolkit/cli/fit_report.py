"""What `calibrate` and `calibration report` print alike: the whole report of a fit, and its figures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.errors import OutputError, SessionError

if TYPE_CHECKING:
    from toolkit.calibration.fit.session_fit import SessionFit

Full = Annotated[bool, typer.Option("--full", help="Print the whole report of the fit; rows in the JSON.")]
Figures = Annotated[
    Path | None, typer.Option("--figures", help="Folder for the fit's figures, PNG and SVG of each.")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """The report as JSON by load, what stands beside the loads, and as text."""

    loads: dict[str, Any]
    payload: dict[str, Any]
    text: str


def check_folder(folder: Path | None) -> None:
    """Refuse a folder for figures that cannot be written, before anything is.

    Raises
    ------
    OutputError
        ``not-writable``
    """
    if folder is None:
        return
    near = folder
    while not near.exists() and near != near.parent:
        near = near.parent
    if not near.is_dir() or not os.access(near, os.W_OK | os.X_OK):
        raise OutputError(
            "the figures cannot be written",
            where=folder,
            got=f"{near} is {'not writable' if near.is_dir() else 'no folder'}",
            expected="a folder with write permission",
            next_step="choose another folder with --figures; nothing was written",
            rule="not-writable",
        )


def tell(fit: SessionFit, *, title: str, full: bool, figures: Path | None) -> Told:
    """Return a fit's report, and write its figures where a folder is named.

    Raises
    ------
    OutputError
        a figure cannot be written; the record stands
    """
    from toolkit.calibration.fit.balance_report import report_balance
    from toolkit.calibration.fit.report import report_session
    from toolkit.report.calibration.text import balance_dict, balance_text, report_dict, report_text

    reports = report_session(fit)
    blocks = [report_text(one) for one in reports] if full else []
    payload: dict[str, Any] = {}
    if fit.session.model == "balance":
        try:
            balance = report_balance(fit)
        except SessionError as error:
            # The finding says why; the record's own form is not touched by it.
            payload["balance"] = None
            blocks += [f"no balance form: {error.what}; got {error.got}"] if full else []
        else:
            payload["balance"] = balance_dict(balance)
            blocks += [balance_text(balance)] if full else []
    if figures is not None:
        payload["figures"] = _write(fit, title, figures)
        blocks.append(f"{len(payload['figures'])} figures in {figures}")
    return Told(
        loads={one.load: report_dict(one, rows=full) for one in reports},
        payload=payload,
        text="".join(f"\n\n{block}" for block in blocks),
    )


def _write(fit: SessionFit, title: str, folder: Path) -> list[str]:
    from toolkit.calibration.fit.report import report_session
    from toolkit.files import write_atomic
    from toolkit.report.calibration.figures import report_figures

    made: dict[str, bytes] = {}
    for one in report_session(fit):
        made |= report_figures(one, title=title)
    for name, data in made.items():
        write_atomic(folder / name, data)
    return sorted(made)
