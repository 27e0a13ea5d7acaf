"""How a record stands for a result, as it travels with the result: every mark follows from it alone.

`registry.standing` decides it; pages, figures, files and answers only say it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NotRequired, TypedDict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.calibration.records.record import CalibrationRecord

DRAFT = "DRAFT"
DRAFT_MARK = f"{DRAFT}, NOT APPROVED"
UNVERIFIED = "UNVERIFIED CALIBRATION"
SINCE = "KNOWN SINCE"
UNSIGNED = "unsigned"
_LONGEST = 130  # characters of a part of the mark that stands on every page


class UsedRecord(TypedDict):
    """The calibration record that computed a result, in an answer."""

    id: Annotated[str, "of the record"]
    sha256: Annotated[str, "of its content"]
    unverified: Annotated[bool, "whether it is a legacy import, without its data"]
    signature: Annotated[str, "who signed the decisions that it rests on, or unsigned"]
    draft: NotRequired[Annotated[bool, "true for a record that is not approved and in force"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationUse:
    """Which record computed a result, and how it stood for it.

    ``unverified``: it is a legacy import. ``draft_reasons``: why it may not make a number that is issued;
    empty for a record in force. ``since``: what became known of it after the day that the result is
    judged by. ``signature``: who signed the decisions that the record rests on, or ``unsigned``
    (`registry.signatures.signature_line`).
    """

    id: str
    sha256: str
    unverified: bool
    draft_reasons: tuple[str, ...] = ()
    since: tuple[str, ...] = ()
    signature: str = UNSIGNED

    @property
    def draft(self) -> bool:
        """True where the result may not be issued."""
        return bool(self.draft_reasons)

    @property
    def status(self) -> str:
        """The record's status in words, as the first page of a document says it."""
        standing = "unverified (legacy import)" if self.unverified else "verified"
        if self.draft:
            standing = f"not approved: {'; '.join(self.draft_reasons)}" + (
                f"; {standing}" if self.unverified else ""
            )
        return standing + (f"; known since: {'; '.join(self.since)}" if self.since else "")

    @property
    def word(self) -> str | None:
        """The mark of a figure; None for a record that needs none."""
        return DRAFT if self.draft else "UNVERIFIED" if self.unverified else None

    @property
    def mark(self) -> str | None:
        """The line that stands on every page of a document; None for a record that needs none."""
        return mark_of((self,))

    def as_dict(self) -> UsedRecord:
        """Return the use under the keys of the answers and manifests."""
        content: UsedRecord = {
            "id": self.id,
            "sha256": self.sha256,
            "unverified": self.unverified,
            "signature": self.signature,
        }
        if self.draft:
            content["draft"] = True
        return content


def mark_of(uses: Sequence[CalibrationUse]) -> str | None:
    """Return the one line that says how the records of a document stand; None where it needs none.

    It names every record; why, as far as a line of a page has room for it.
    """
    marks = []
    for word, applies, why in (
        (DRAFT_MARK, [use for use in uses if use.draft], "draft_reasons"),
        (UNVERIFIED, [use for use in uses if use.unverified], None),
        (SINCE, [use for use in uses if use.since], "since"),
    ):
        if applies:
            text = f"{word}: {', '.join(dict.fromkeys(use.id for use in applies))}"
            if why and len(applies) == 1:
                text += f": {'; '.join(getattr(applies[0], why))}"
            marks.append(text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3].rstrip()}...")
    return " - ".join(marks) or None


def signature_of(uses: Sequence[CalibrationUse]) -> str:
    """Return who signed what a result rests on; one unsigned record makes it unsigned."""
    lines = dict.fromkeys((use.id, use.signature) for use in uses)
    if not lines or any(signature == UNSIGNED for _, signature in lines):
        return UNSIGNED
    return "; ".join(f"{record}: {signature}" for record, signature in lines)


def not_asked(record: CalibrationRecord) -> CalibrationUse:
    """Return the use of a record that no registry was asked about: what it computes is a draft."""
    return CalibrationUse(
        id=record.id,
        sha256=record.sha256,
        unverified=not record.verified,
        draft_reasons=("no registry was asked whether it is in force",),
    )
