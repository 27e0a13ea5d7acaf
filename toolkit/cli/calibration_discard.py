"""`toolkit calibration discard ID --reason TEXT`: the end of a candidate."""

from __future__ import annotations

from typing import Annotated

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer
from toolkit.cli.home import calibrations_folder


def command(
    record_id: Annotated[str, typer.Argument(metavar="ID", help="Record id, such as m15-r2.")],
    reason: Annotated[str, typer.Option("--reason", help="Why; the ledger keeps it.")],
    by: Annotated[str, typer.Option("--by", help="Who discards.")] = "not stated",
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Discard a candidate that was never approved: it can never be, and 'list' hides it.

    The record stays and is verified for ever. The same session entered again is refused with this reason,
    unless with 'toolkit calibrate SESSION.toml --again', which makes a record with a new id.

    Example: toolkit calibration discard m15-r3 --reason "cable of D52 was loose" --by "first person"
    """
    from toolkit.calibration.registry.approval import discard
    from toolkit.calibration.registry.registry import Registry, instrument_of

    registry = Registry(calibrations_folder(calibrations, home))
    status = discard(registry, record_id, reason=reason, by=by)
    head = registry.head(instrument_of(record_id))
    payload = {"id": record_id, "status": status.state, "reason": status.reason, "head": head}
    answer(payload, f"{record_id}  discarded: {status.reason}", as_json=as_json, quiet=quiet)
    return 0
