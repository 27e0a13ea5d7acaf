"""How a command ends that wrote a signing request; every command knows it, and few import what is in one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toolkit.trust.requests import Request


class Requested(Exception):  # noqa: N818  no error: the decision waits for its signatures
    """A decision was written to a file, to be signed elsewhere; the ledger is as it was."""

    def __init__(self, request: Request) -> None:
        super().__init__(str(request.path))
        self.request = request
