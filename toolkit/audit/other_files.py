"""The other files of a test as witnesses of which side of a disagreement is wrong (`toolkit.audit.sides`).

What a file leaves open, its test may know. Its force over load lies on the surface that all others make
(`toolkit.reduction.strays`) by its recorded values or by its cells, and not by both; and where most files
of a test disagree in the same way, one of them that is decided by itself decides for all: a wrong equation
computes every file of a day, a changed file stands alone. Where no file decides, the slopes of the whole
test do; and where all of its files disagree in one way, that is an equation.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.audit.model import DisagreeingSides, Which
from toolkit.reduction.physics import RULES, Readings, departures
from toolkit.reduction.strays import off_curve

if TYPE_CHECKING:
    from toolkit.audit.resume import Files
    from toolkit.channels import Rotation

_ALL = 3  # files that agree to the last: a program computes them, nobody changes a column in each
_MOST = 4  # one open file in so many is asked of the others; where there are more, they are no witnesses
_NEEDED = ("SA_deg", "FY_N", "MZ_Nm", "FY_change_N", "MZ_change_Nm", "step_FZ_N")
_RECORDED, _COMPUTED = False, True


@dataclass(frozen=True, slots=True, kw_only=True)
class OnCurve:
    """A load block on the curve of its test, in SAE axes that follow the travel; see `Condition`."""

    file: str
    rotation: Rotation
    first_row: int
    step_SA: float | None
    step_FZ: float | None
    SA: float
    FZ: float
    FY: float
    MZ: float


def by_other_files(files: Files) -> dict[str, DisagreeingSides]:
    """Return the side of every file that its own rows leave open and the other files of its test decide."""
    places: dict[str, list[int]] = {}
    asked: set[str] = set()
    for place, line in enumerate(files.plain()):
        key = test_of(line)
        places.setdefault(key, []).append(place)
        if line["sides"] is not None and line["sides"]["side"] == "open":
            asked.add(key)
    answers: dict[str, DisagreeingSides] = {}
    for key in sorted(asked):
        answers |= _of_test([files.line(place) for place in places[key]])
    return answers


def test_of(line: Mapping[str, Any]) -> str:
    """Return what the files of one test share: the folder of its test.toml, else their own."""
    return f"{line['instrument']}|{line['test'] or line['path'].rpartition('/')[0]}"


def off_the_curve(lines: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return the files of a test whose corrected values lie off the curve of the others: path to message."""
    return _off_curve([p for line in lines for p in _points(line, computed=not _keeps_recorded(line))])


def _off_curve(points: Sequence[OnCurve]) -> dict[str, str]:
    return off_curve(points, "MZ") | off_curve(points, "FY")


def _keeps_recorded(line: Mapping[str, Any]) -> bool:
    return line["sides"] is not None and line["sides"]["side"] != "forces"


def _points(line: Mapping[str, Any], *, computed: bool) -> list[OnCurve]:
    sign = line["to_SAE"]
    points = []
    for block in line["conditions"]:
        if any(block[key] is None for key in _NEEDED) or block["FZ_N"] <= 0:
            continue
        step = block["step_SA_deg"]
        FY, MZ = block["FY_N"], block["MZ_Nm"]
        if computed:
            FY, MZ = FY + block["FY_change_N"], MZ + block["MZ_change_Nm"]
        points.append(
            OnCurve(
                file=line["path"],
                rotation=line["rotation"],
                first_row=block["first_row"],
                step_SA=None if step is None else sign["SA"] * math.radians(step),
                step_FZ=block["step_FZ_N"],
                SA=sign["SA"] * math.radians(block["SA_deg"]),
                FZ=block["FZ_N"],
                FY=sign["FY"] * FY,
                MZ=sign["MZ"] * MZ,
            )
        )
    return points


def _of_test(lines: Sequence[Mapping[str, Any]]) -> dict[str, DisagreeingSides]:
    judged: dict[str, DisagreeingSides] = {}
    open_lines = [line for line in lines if _side(line) == "open"]
    kinds = Counter(_kind(line) for line in lines if line["sides"] is not None)
    # What most files of a test agree on takes no curve: a fit of the others for each side of each file.
    for kind, count in kinds.items():
        alike = [line for line in open_lines if _kind(line) == kind]
        if not alike or 2 * count < len(lines) or count < 2:
            continue
        told = _by_company(kind, count, lines) or _by_slopes(lines)
        if told is not None:
            side, reason = told
            judged |= {
                line["path"]: DisagreeingSides(side=side, reason=reason, grade=line["sides"]["grade"])
                for line in alike
            }
    left = [line for line in open_lines if line["path"] not in judged]
    if len(left) * _MOST <= len(lines):
        curves: dict[tuple[bool, ...], dict[str, str]] = {}
        for line in left:
            verdict = _by_curve(line, lines, curves)
            if verdict is not None:
                judged[line["path"]] = verdict
    return _by_folders([line for line in lines if line["path"] not in judged]) | judged


def _side(line: Mapping[str, Any]) -> Which | None:
    side: Which | None = None if line["sides"] is None else line["sides"]["side"]
    return side


def _kind(line: Mapping[str, Any]) -> tuple[str, str | None, str | None] | None:
    # A change of all rows, by what it is.
    if line["sides"] is None or len(line["segments"]) != 1:
        return None
    return line["sides"]["grade"], line["record"], line["variant"]


def _by_curve(
    line: Mapping[str, Any],
    lines: Sequence[Mapping[str, Any]],
    curves: dict[tuple[bool, ...], dict[str, str]],
) -> DisagreeingSides | None:
    # In every world, whatever the other open files hold; ``curves`` are those that were asked already.
    answers: set[Which] = set()
    messages: list[str] = []
    for world in (_COMPUTED, _RECORDED):
        stray: dict[bool, str] = {}
        for mine in (_COMPUTED, _RECORDED):
            sides = tuple(
                mine if other is line else world if _side(other) == "open" else _side(other) != "cells"
                for other in lines
            )
            if sides not in curves:
                of_each = zip(lines, sides, strict=True)
                curves[sides] = _off_curve([p for one, side in of_each for p in _points(one, computed=side)])
            if line["path"] in curves[sides]:
                stray[mine] = curves[sides][line["path"]]
        if len(stray) != 1:
            return None
        answers.add("cells" if _COMPUTED in stray else "forces")
        messages += stray.values()
    if len(answers) != 1:
        return None
    side = answers.pop()
    of = "by the cells" if side == "cells" else "as recorded"
    return DisagreeingSides(side=side, reason=f"{of}, {messages[0]}", grade=line["sides"]["grade"])


def _by_company(
    kind: tuple[str, str | None, str | None] | None, count: int, lines: Sequence[Mapping[str, Any]]
) -> tuple[Which, str] | None:
    decided = [line for line in lines if _kind(line) == kind and _side(line) in ("forces", "cells")]
    if kind is None or "cells" in map(_side, decided):
        return None
    if not decided:
        return None
    others = f"{count} of {len(lines)} files of the test disagree in the same way"
    return "forces", f"{others}, and {decided[0]['path']} shows that Fy and Mz are wrong"


def _by_folders(lines: Sequence[Mapping[str, Any]]) -> dict[str, DisagreeingSides]:
    """Return the files of folders in which all agree on one change of all their rows, and none decides."""
    folders: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        if line["segments"]:
            folders.setdefault(line["path"].rpartition("/")[0], []).append(line)
    judged: dict[str, DisagreeingSides] = {}
    for beside in folders.values():
        kinds = {_kind(line) for line in beside}
        kind = next(iter(kinds))
        if len(beside) < _ALL or len(kinds) > 1 or kind is None or kind[0] == "unknown":
            continue
        if {_side(line) for line in beside} != {"open"}:
            continue
        reason = (
            f"all {len(beside)} files of the folder disagree in the same way, as one wrong equation "
            "computes them: by hand a column would have been changed in each"
        )
        judged |= {
            line["path"]: DisagreeingSides(side="forces", reason=reason, grade=line["sides"]["grade"])
            for line in beside
        }
    return judged


def _by_slopes(lines: Sequence[Mapping[str, Any]]) -> tuple[Which, str] | None:
    recorded, computed = (_broken(lines, computed=side) for side in (_RECORDED, _COMPUTED))
    if recorded and not computed:
        return "forces", f"over the test the recorded values are impossible: {recorded}"
    if computed and not recorded:
        return "cells", f"over the test the values by the cells are impossible: {computed}"
    return None


def _broken(lines: Sequence[Mapping[str, Any]], *, computed: bool) -> str | None:
    points = [p for line in lines for p in _points(line, computed=computed)]
    if not points:
        return None
    none = np.zeros(len(points))
    told = departures(
        Readings(
            place=tuple(p.file for p in points),
            FZ=np.array([p.FZ for p in points]),
            SA=np.array([p.SA for p in points]),
            FY=np.array([p.FY for p in points]),
            MZ=np.array([p.MZ for p in points]),
            reverse=np.array([p.rotation == "reverse" for p in points]),
            block=tuple((p.step_SA, p.step_FZ) for p in points),
            u_FY=none, u_MZ=none, FX=none, IA=none,
        )
    )  # fmt: skip
    return next((departure.message for departure in told if departure.rule in RULES), None)
