"""The plans that a home keeps, and the command that makes one of what a form says."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from toolkit.errors import ConfigError, ToolkitError, UnreadableError
from toolkit.inputs import RESULT_FILE, read_input
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.home import PLAN, TEMPLATES

PLANS = "plans"
"""Folder of the home into which plans of the workbench are written."""
FIXTURES = "fixtures"
"""Folder of the home for files of loading fixtures; they may lie in the home itself too."""
PlanKind = Literal["session", "test", "next", "interval"]
KINDS: tuple[PlanKind, ...] = get_args(PlanKind)
_NEEDED: Mapping[PlanKind, tuple[str, ...]] = {
    "session": ("instrument", "record", "rows", "check", "outlook", "verification", "gives_up"),
    "test": ("machine", "like", "plan", "protocol", "values", "gives_up"),
    "next": ("members", "steps", "conditions", "pairs", "power", "together", "lost"),
    "interval": ("instrument", "record", "days", "chosen", "risks", "reliability", "next"),
}
_WRITTEN = (
    "plan.pdf", "plan.docx", "SESSION.toml", "loads.csv", "check.csv", "sheet.csv", "protocol.toml",
    "plan.toml", "next.csv", "predictions.csv", "operator.txt", "plan.txt", "plan.json",
)  # fmt: skip
_PICTURE = re.compile(r"next_[\w-]{1,60}\.png", re.ASCII)
# Fields of a form by the option that each stands for; what may be said several times is separated by commas.
_OPTIONS: Mapping[PlanKind, Mapping[str, str]] = {
    "session": {"minutes": "--minutes", "loads": "--loads", "criterion": "--criterion"},
    "test": {
        "minutes": "--minutes",
        "sliding": "--sliding",
        "rise": "--rise",
        "between_files": "--between-files",
    },
    "next": {"sample_rate": "--sample-rate", "minutes": "--minutes", "budget": "--budget"},
    "interval": {"reliability": "--reliability", "tests": "--tests"},
}
_SWITCHES: Mapping[PlanKind, Mapping[str, str]] = {
    "session": {"two_levels": "--two-levels"}, "test": {}, "next": {}, "interval": {},
}  # fmt: skip
_REPEATED: Mapping[PlanKind, Mapping[str, str]] = {
    "session": {"u": "--u"},
    "test": {"u": "--u", "load": "--load", "spread": "--spread"},
    "next": {"limit": "--limit", "rate": "--rate"},
    "interval": {},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptPlan:
    """A plan that a home keeps: its kind, its answer as `--json` has it, and the names of its files."""

    kind: PlanKind
    answer: Mapping[str, Any]
    files: tuple[str, ...]
    pictures: tuple[str, ...]


def read_plan(folder: Path) -> KeptPlan:
    """Read a plan.

    Raises
    ------
    UnreadableError
        it is none
    """
    try:
        answer = json.loads(read_input(folder / PLAN, RESULT_FILE))
        kind = answer["kind"]
        lacking = [key for key in (*_NEEDED[kind], "assumptions", "findings") if key not in answer]
    except (ValueError, TypeError, KeyError) as error:
        raise _none(folder, "no answer of a plan") from error
    if lacking:
        raise _none(folder, f"no {', '.join(lacking)}")
    names = sorted(path.name for path in folder.iterdir() if path.is_file() and not path.is_symlink())
    return KeptPlan(
        kind=kind, answer=answer, files=tuple(name for name in _WRITTEN if name in names),
        pictures=tuple(name for name in names if _PICTURE.fullmatch(name)),
    )  # fmt: skip


def titles_of(kept: KeptPlan) -> dict[str, str]:
    """Return what the characteristics of a test's plan are called, by the names of its demands."""
    from toolkit.planning.demands import title_of

    return {value["name"]: title_of(value["name"]) for value in kept.answer.get("values", ())}


def fixtures_of(home: Path) -> dict[str, str]:
    """Return the loading fixtures of a home by id: those in it and in `FIXTURES` in it."""
    from toolkit.declared import read
    from toolkit.machine.hub import LoadingFixtures

    places = {}
    for folder in (home, home / FIXTURES):
        for path in sorted(folder.glob("*.toml")) if not folder.is_symlink() else ():
            try:
                read(LoadingFixtures, path)
            except ToolkitError:
                continue
            place = path.relative_to(home).as_posix()
            places[holding_id(place)] = place
    return places


def plan_words(
    home: Path,
    kind: PlanKind,
    form: Mapping[str, str],
    subject: str | None,
    template: str | None,
    fixtures: str | None = None,
) -> tuple[str, ...]:
    """Return the command of a plan, in a folder of its own below ``plans/``.

    ``subject`` is the instrument of a session or an interval, the place in the home of the test that a test
    is planned like (None: passenger tires), or of the answer whose class a run is to part; ``fixtures``
    the place of a session's loading fixtures. Fields that are left empty are left to the command.

    Raises
    ------
    ConfigError
        ``usage``: a plan of something without it
    """
    if subject is None and kind != "test":
        raise ConfigError(
            "a plan needs what it is for", where=kind, got="nothing", expected="a choice of the form",
            next_step="choose it; nothing was started", rule="usage",
        )  # fmt: skip
    words = ["plan", kind]
    if kind in ("session", "interval"):
        words.append(str(subject))
    elif kind == "next":
        words += [f"./{subject}", "--isolated"]
    elif subject is not None:
        words += ["--like", f"./{subject}"]
    if kind == "session" and fixtures is not None:
        words += ["--fixtures", f"./{fixtures}"]
    stated = {field: form.get(field, "").strip() for field in form}
    for field, option in _OPTIONS[kind].items():
        if stated.get(field):
            # In one word with its option: what somebody typed is never an option of its own.
            words.append(f"{option}={stated[field]}")
    words += [option for field, option in _SWITCHES[kind].items() if stated.get(field)]
    for field, option in _REPEATED[kind].items():
        parts = (part.strip() for part in stated.get(field, "").split(","))
        words += [f"{option}={part}" for part in parts if part]
    if template is not None:
        words += ["--template", f"{TEMPLATES}/{template}"]
    return (*words, "--out", f"{PLANS}/{_free(home)}", "--home", ".")


def _free(home: Path) -> str:
    """Return a name that no plan of the home has."""
    folder = home / PLANS
    numbers = [
        int(path.name.removeprefix("plan-"))
        for path in (folder.iterdir() if folder.is_dir() else ())
        if re.fullmatch(r"plan-\d{1,9}", path.name)
    ]
    return f"plan-{max(numbers, default=0) + 1}"


def _none(folder: Path, actual: str) -> UnreadableError:
    return UnreadableError(
        "the plan cannot be read", where=folder / PLAN, got=actual,
        expected="plan.json as 'toolkit plan' writes it with --out", next_step="plan again", rule="no-file",
    )  # fmt: skip
