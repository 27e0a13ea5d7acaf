"""The first line of an audit: how many files are wrong, by how much, why, and since when."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from toolkit.audit.model import CLEAN
from toolkit.audit.sides import disputed
from toolkit.declared import Entry, derived
from toolkit.reduction.physics import RULES

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit

SMALL_FY_N, SMALL_MZ_Nm = 0.1, 0.01
"""The resolution to which changes are printed: what is smaller is no wrong value to anybody."""
Judged = Literal[
    "no_recording", "unreadable", "right", "altered", "disputed", "unjudged", "bare", "small", "wrong"
]
_CAUSES = 3  # named in the sentence; the answer holds all
_PLACE = "\N{NARROW NO-BREAK SPACE}"


@dataclass(frozen=True, slots=True, kw_only=True)
class CauseCount:
    """A cause of wrong values, and in how many files."""

    cause: str
    files: int
    largest: Annotated[bool, Entry(output=False)] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """What an archive holds, in a sentence and in numbers."""

    files: int
    wrong: Annotated[int, Entry("files with values that the record in force changes")]
    FY_N: Annotated[float, Entry("largest change", key="FY_max_abs_N")]
    MZ_Nm: Annotated[float, Entry("largest change", key="MZ_max_abs_Nm")]
    causes: Annotated[tuple[CauseCount, ...], Entry("the most frequent first")]
    first: Annotated[str | None, Entry("first month with a wrong file", key="from")]
    last: Annotated[str | None, Entry("last one", key="to")]
    unjudged: Annotated[int, Entry("files whose change cannot be computed")]
    unreadable: int
    impossible: Annotated[int, Entry("files besides the wrong ones with an Fy or Mz that no tire has")] = 0
    altered: Annotated[int, Entry("files with right forces beside changed cells", key="altered_cells")] = 0
    disputed: Annotated[
        int, Entry("files of which nothing says whether forces or cells are wrong", key="undecided")
    ] = 0
    small: Annotated[
        int,
        Entry(
            "files by another record, or perhaps so, that the one in force changes by less than is printed"
        ),
    ] = 0
    stepping: Annotated[int, Entry("files with a force or cell that steps where nothing moved")] = 0
    copies: Annotated[
        int, Entry("files that a repair wrote: their agreement proves nothing", key="corrected_copies")
    ] = 0
    no_recording: Annotated[int, Entry("notes, lock files and the like")] = 0
    bare: Annotated[
        int | None, Entry("files that hold no Fy and no Mz of their own", key="without_values", sparse=True)
    ] = None

    @property
    @derived(after="")
    def sentence(self) -> str:
        """The headline as one sentence."""
        readable = self.files - self.unreadable - self.no_recording
        if readable == 0:
            return "No file could be read as a recording"
        parts = []
        if self.wrong:
            parts += [self._size(), f"cause: {self._cause()}", self._since()]
        if self.impossible:
            verb = "holds" if self.impossible == 1 else "hold"
            subject = _files(self.impossible, more=bool(self.wrong))
            parts.append(f"{subject} {verb} an Fy or Mz that no tire has")
        if self.altered:
            verb = "holds right forces beside" if self.altered == 1 else "hold right forces beside"
            parts.append(f"{_files(self.altered)} {verb} changed cells, and must not be repaired")
        if self.disputed:
            verb = "disagrees with its cells" if self.disputed == 1 else "disagree with their cells"
            parts.append(f"{_files(self.disputed)} {verb}, and nothing says which side is wrong")
        if self.small:
            verb = "was" if self.small == 1 else "were"
            parts.append(
                f"{_files(self.small)} {verb} computed otherwise than by the record in force, or may have "
                f"been, which changes less than {SMALL_FY_N:g} N and {SMALL_MZ_Nm:g} N·m"
            )
        if self.stepping:
            verb = "holds" if self.stepping == 1 else "hold"
            parts.append(
                f"{_files(self.stepping)} {verb} a force or cell that steps while the machine stands still"
            )
        with_values = readable - (self.bare or 0)
        doubts = self.wrong + self.unjudged + self.impossible + self.altered + self.disputed
        if with_values and not (doubts + self.small + self.stepping):
            subject = "The file carries" if with_values == 1 else f"All {with_values} files carry"
            parts.append(f"{subject} the values of the record in force")
        if self.copies:
            verb = "is a corrected copy" if self.copies == 1 else "are corrected copies"
            parts.append(
                f"{_files(self.copies)} {verb}, computed from the cells beside them: that they agree "
                "proves nothing of the cells"
            )
        if self.unjudged:
            subject = _files(self.unjudged, more=bool(self.wrong))
            parts.append(f"{subject} cannot be judged: no record in force is known or fits")
        if self.bare:
            verb = (
                "holds no Fy and no Mz of its own" if self.bare == 1 else "hold no Fy and no Mz of their own"
            )
            parts.append(f"{_files(self.bare, more=with_values > 0)} {verb}")
        if self.unreadable:
            parts.append(f"{_files(self.unreadable)} cannot be read")
        if self.no_recording:
            verb = "is no recording" if self.no_recording == 1 else "are no recordings"
            parts.append(f"{_files(self.no_recording)} {verb}")
        return "; ".join(parts)

    def _size(self) -> str:
        carry = f"{_files(self.wrong)} {'carries' if self.wrong == 1 else 'carry'}"
        force, moment = f"up to {_number(self.FY_N)} N", f"up to {_number(self.MZ_Nm)} N·m"
        if self.FY_N and self.MZ_Nm:
            return f"{carry} a wrong Fy, {force}, and Mz, {moment}"
        return f"{carry} a wrong Mz, {moment}" if self.MZ_Nm else f"{carry} a wrong Fy, {force}"

    def _cause(self) -> str:
        if len(self.causes) == 1:
            return self.causes[0].cause
        # The size that the sentence states has its cause in it, however few files share that.
        named = sorted(self.causes, key=lambda count: not count.largest)[:_CAUSES]
        counted = [f"{count.cause} ({count.files})" for count in self.causes if count in named]
        remaining = sum(count.files for count in self.causes if count not in named)
        return ", ".join(counted) + (f", others ({remaining})" if remaining else "")

    def _since(self) -> str:
        if self.first is None:
            return "since when is unknown: no test date"
        return f"from {self.first} to {self.last}" if self.first != self.last else f"in {self.first}"


def headline(audit: ArchiveAudit) -> Headline:
    """Return the headline of an audit; the files are read once."""
    return headline_of(audit.files.plain())


def headline_of(files: Iterable[Mapping[str, Any]]) -> Headline:
    """Return the headline of the files of an audit, as its answer lists them."""
    judged: Counter[Judged] = Counter()
    impossible = stepping = copies = 0
    FY = MZ = 0.0
    largest: dict[str, str] = {}
    causes: Counter[str] = Counter()
    months: set[str] = set()
    for file in files:
        kind, repair = judged_of(file), file["repair"]
        judged[kind] += 1
        notes = {note["rule"] for note in file.get("notes", ())}
        impossible += (repair is None or kind == "right") and bool(notes & {*RULES})
        stepping += kind == "right" and "discontinuity" in notes
        copies += kind == "right" and "corrected-copy" in notes
        if kind == "wrong":
            cause = _cause_of(file)
            causes[cause] += 1
            if (repair["FY_max_abs_N"] or 0.0) > FY:
                FY, largest["FY"] = repair["FY_max_abs_N"], cause
            if (repair["MZ_max_abs_Nm"] or 0.0) > MZ:
                MZ, largest["MZ"] = repair["MZ_max_abs_Nm"], cause
            if file["date"]:
                months.add(file["date"][:7])
    counted = tuple(
        CauseCount(cause=cause, files=of, largest=cause in largest.values())
        for cause, of in causes.most_common()
    )
    return Headline(
        files=judged.total(), wrong=judged["wrong"], FY_N=FY, MZ_Nm=MZ, causes=counted,
        first=min(months, default=None), last=max(months, default=None), unjudged=judged["unjudged"],
        unreadable=judged["unreadable"], impossible=impossible, bare=judged["bare"] or None,
        small=judged["small"], altered=judged["altered"], disputed=judged["disputed"],
        no_recording=judged["no_recording"], stepping=stepping, copies=copies,
    )  # fmt: skip


def judged_of(file: Mapping[str, Any]) -> Judged:
    """Return what a file of an audit is, by its line of the answer: the one rule of every list and count.

    ``small``: a record that was not in force computed it, or may have, and the one in force changes less than
    is printed.
    """
    grade, repair = file["grade"], file["repair"]
    of_grade: dict[str, Judged] = {
        "no_recording": "no_recording", "unreadable": "unreadable", "altered_cells": "altered",
        **dict.fromkeys(CLEAN, "right"),
    }  # fmt: skip
    if grade in of_grade:
        return of_grade[grade]
    if disputed(file):
        return "disputed"
    if repair is None:
        return "unjudged"
    FY, MZ = repair["FY_max_abs_N"], repair["MZ_max_abs_Nm"]
    if FY is None and MZ is None:
        return "bare"
    is_small = max((FY or 0.0) / SMALL_FY_N, (MZ or 0.0) / SMALL_MZ_Nm) < 1.0
    return "small" if grade in ("stale", "ambiguous") and is_small else "wrong"


def _cause_of(file: Mapping[str, Any]) -> str:
    if file["variant"]:
        return str(file["variant"])
    if file["grade"] == "stale":
        return f"computed by {file['record']}, which was not in force"
    if file["grade"] == "ambiguous":
        first, *others = file["candidates"]
        return "one of several records" if others else f"{first} with signs that the files leave open"
    return "no record explains them"


def _files(count: int, *, more: bool = False) -> str:
    further = " more" if more else ""
    return f"1{further} file" if count == 1 else f"{count}{further} files"


def _number(value: float) -> str:
    digits = 0 if value >= 100 else 1 if value >= 1 else 2
    return f"{value:,.{digits}f}".replace(",", _PLACE)
