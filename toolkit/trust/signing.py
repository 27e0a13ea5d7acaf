"""Who signs a decision now: keys at hand, and requests that travel to the others."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.errors import TrustError
from toolkit.trust.decisions import stated
from toolkit.trust.keys import Signer
from toolkit.trust.people import RECOVERY, Action, History, objections
from toolkit.trust.requests import Request
from toolkit.trust.ssh import PublicKey


@dataclass(frozen=True, slots=True, kw_only=True)
class Travel:
    """How a decision is signed elsewhere: the file of a ``request`` to write, or ``answers`` to it.

    ``files`` are those whose hashes the request has; they lie beside it, to be read before it is signed.
    """

    request: Path | None = None
    answers: tuple[Request, ...] = ()
    files: tuple[Path, ...] = ()


HERE = Travel()


@dataclass(frozen=True, slots=True, kw_only=True)
class Signing:
    """Who signs now: the people of the laboratory, the keys at hand, and what travels to other keys."""

    history: History
    signers: tuple[Signer, ...] = ()
    travel: Travel = HERE

    def demand_key(self, action: Action, where: object) -> None:
        """Refuse a decision that nobody signs.

        Raises
        ------
        TrustError
            ``not-signed``
        """
        if self.history.now is None or self.signers or self.travel.answers or self.travel.request:
            return
        demand = self.history.now.people.policy.demand(action)
        raise TrustError(
            f"to {action} takes a signature", where=where, got="no key",
            expected=f"{demand.signatures} by {' or '.join(demand.roles)}",
            next_step="sign with --sign KEY, or make a request for another computer with --request FILE; "
            "nothing was changed",
            rule="not-signed",
        )  # fmt: skip

    def check(
        self, event: Mapping[str, Any], action: Action, signatures: Sequence[PublicKey],
        operators: Collection[str],
    ) -> None:  # fmt: skip
        """Refuse a decision that these keys do not make.

        Raises
        ------
        TrustError
            ``not-allowed``: it takes other people, or more
        """
        time = event["time"]
        version = self.history.at(time)
        reasons = objections(
            version, action, time, signatures, stated=stated(event, action), operators=operators
        )
        owners = [None if version is None else version.people.owner(public) for public in signatures]
        if action == "approve" and any(owner is not None and owner.id == RECOVERY for owner in owners):
            reasons.append("the recovery key approves nothing: whoever keeps it may have entered the record")
        if reasons:
            raise TrustError(
                f"these keys cannot {action}", where=event["id"], got="; ".join(reasons),
                expected=f"what {action} takes by the laboratory's policy",
                next_step="see 'toolkit person list'; nothing was changed", rule="not-allowed",
            )  # fmt: skip
