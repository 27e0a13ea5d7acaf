"""The first line of an audit: how many files are wrong, by how much, why, and since when."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.audit.model import CLEAN
from toolkit.reduction.physics import RULES

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit

_CAUSES = 3  # named in the sentence; the answer holds all
_PLACE = "\N{NARROW NO-BREAK SPACE}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """What an audit found, in numbers.

    ``wrong`` files change by the record in force on their day, ``FY_N`` and ``MZ_Nm`` at most; ``causes`` are
    the reasons with their files, the most frequent first; ``first`` and ``last`` the months of their tests.
    ``unjudged`` files are not right either, but no record says what they should hold. ``impossible`` files
    are not among the wrong ones and hold an Fy or Mz that no tire has. ``bare`` files hold neither of
    their own: nothing in them is right or wrong.
    """

    files: int
    wrong: int
    FY_N: float
    MZ_Nm: float
    causes: tuple[tuple[str, int], ...]
    first: str | None
    last: str | None
    unjudged: int
    unreadable: int
    impossible: int = 0
    bare: int = 0

    @property
    def sentence(self) -> str:
        """The headline as one sentence."""
        readable = self.files - self.unreadable
        if readable == 0:
            return "No file could be read as a recording"
        parts = []
        if self.wrong:
            parts += [self._size(), f"cause: {self._cause()}", self._since()]
        if self.impossible:
            verb = "holds" if self.impossible == 1 else "hold"
            subject = _files(self.impossible, more=bool(self.wrong))
            parts.append(f"{subject} {verb} an Fy or Mz that no tire has")
        with_values = readable - self.bare
        if with_values and not (self.wrong or self.unjudged or self.impossible):
            subject = "The file carries" if with_values == 1 else f"All {with_values} files carry"
            parts.append(f"{subject} the values of the record in force")
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
        return "; ".join(parts)

    def _size(self) -> str:
        carry = f"{_files(self.wrong)} {'carries' if self.wrong == 1 else 'carry'}"
        force, moment = f"up to {_number(self.FY_N)} N", f"up to {_number(self.MZ_Nm)} N·m"
        if self.FY_N and self.MZ_Nm:
            return f"{carry} a wrong Fy, {force}, and Mz, {moment}"
        return f"{carry} a wrong Mz, {moment}" if self.MZ_Nm else f"{carry} a wrong Fy, {force}"

    def _cause(self) -> str:
        if len(self.causes) == 1:
            return self.causes[0][0]
        counted = [f"{cause} ({count})" for cause, count in self.causes[:_CAUSES]]
        remaining = sum(count for _, count in self.causes[_CAUSES:])
        return ", ".join(counted) + (f", others ({remaining})" if remaining else "")

    def _since(self) -> str:
        if self.first is None:
            return "since when is unknown: no test date"
        return f"from {self.first} to {self.last}" if self.first != self.last else f"in {self.first}"

    def as_dict(self) -> dict[str, Any]:
        """Return the headline under the keys of the answer."""
        return {
            "sentence": self.sentence,
            "files": self.files,
            "wrong": self.wrong,
            "FY_max_abs_N": self.FY_N,
            "MZ_max_abs_Nm": self.MZ_Nm,
            "causes": [{"cause": cause, "files": count} for cause, count in self.causes],
            "from": self.first,
            "to": self.last,
            "unjudged": self.unjudged,
            "unreadable": self.unreadable,
            "impossible": self.impossible,
            **({"without_values": self.bare} if self.bare else {}),
        }


def headline(audit: ArchiveAudit) -> Headline:
    """Return the headline of an audit; the files are read once."""
    return headline_of(audit.files.plain())


def headline_of(files: Iterable[Mapping[str, Any]]) -> Headline:
    """Return the headline of the files of an audit, as its answer lists them."""
    count = wrong = unjudged = unreadable = impossible = bare = 0
    FY = MZ = 0.0
    causes: Counter[str] = Counter()
    months: set[str] = set()
    for file in files:
        count += 1
        repair = file["repair"]
        unchanged = repair is None or file["grade"] in CLEAN
        impossible += unchanged and any(note["rule"] in RULES for note in file.get("notes", ()))
        if file["grade"] == "unreadable":
            unreadable += 1
        elif file["grade"] in CLEAN:
            continue
        elif repair is None:
            unjudged += 1
        elif repair["FY_max_abs_N"] is None and repair["MZ_max_abs_Nm"] is None:
            bare += 1
        else:
            wrong += 1
            FY = max(FY, repair["FY_max_abs_N"] or 0.0)
            MZ = max(MZ, repair["MZ_max_abs_Nm"] or 0.0)
            causes[_cause_of(file)] += 1
            if file["date"]:
                months.add(file["date"][:7])
    return Headline(
        files=count, wrong=wrong, FY_N=FY, MZ_Nm=MZ, causes=tuple(causes.most_common()),
        first=min(months, default=None), last=max(months, default=None), unjudged=unjudged,
        unreadable=unreadable, impossible=impossible, bare=bare,
    )  # fmt: skip


def _cause_of(file: Mapping[str, Any]) -> str:
    if file["variant"]:
        return str(file["variant"])
    if file["grade"] == "stale":
        return f"computed by {file['record']}, which was not in force"
    if file["grade"] == "ambiguous":
        return "one of several records"
    return "no record explains them"


def _files(count: int, *, more: bool = False) -> str:
    further = " more" if more else ""
    return f"1{further} file" if count == 1 else f"{count}{further} files"


def _number(value: float) -> str:
    digits = 0 if value >= 100 else 1 if value >= 1 else 2
    return f"{value:,.{digits}f}".replace(",", _PLACE)
