"""Records, budgets, certificates and verification: packaged ones, and those that sessions make."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from tests.golden.entries import golden
from tests.golden.sessions import SESSIONS, packaged_session
from tests.golden.surface import CALIBRATIONS, TEMPLATES
from tests.golden.workplace import Workplace, read_record

PACKAGED = ("m15-r1", "m15-r2", "m15-virtual-r1")
FITTED = "m15-virtual-r1"
DAY = "2026-06-01"


def _instrument(record: str) -> str:
    return record.rsplit("-r", 1)[0]


@golden("calibration/packaged", quick=True)
def packaged(place: Workplace) -> Any:
    """Every record of the packaged registry: its content, its state, its history, its fit."""
    return {
        "verify": place.packaged("calibration", "verify"),
        "list": place.packaged("calibration", "list", "--known-at", DAY),
        "history": {name: place.packaged("calibration", "history", name) for name in ("m15", "m15-virtual")},
        "records": {
            name: {
                "record": read_record(CALIBRATIONS / _instrument(name) / f"{name}.json"),
                "show": place.packaged("calibration", "show", name, "--known-at", DAY),
                "budget": place.packaged("calibration", "budget", name),
            }
            for name in PACKAGED
        },
        "diff": place.packaged("calibration", "diff", "m15-r1", "m15-r2"),
        "fit": place.packaged("calibration", "report", FITTED),
        "monte_carlo": place.packaged(
            "calibration", "budget", FITTED, "--load", "FY", "--at", "3000N", "--monte-carlo", 20000
        ),
    }


@golden("calibration/packaged-session", quick=True)
def packaged_again(place: Workplace) -> Any:
    """The packaged session in a new registry: the same record, hash and all."""
    folder = CALIBRATIONS / "m15-virtual"
    stored = {
        name: (folder / f"{FITTED}.{name}").read_text() for name in ("session.toml", "loads.csv", "check.csv")
    }
    return _entered(place, packaged_session(stored), FITTED)


def _entered(place: Workplace, files: dict[str, str], record: str) -> dict[str, Any]:
    """Enter a session into a new registry and approve it; return all that is said of it."""
    session = place.write(files, "session") / "SESSION.toml"
    registry = place.folder / "calibrations"
    registry.mkdir()

    def ask(*words: object) -> dict[str, Any]:
        return place.answer(*words, calibrations=registry)

    answers = {"calibrate": ask("calibrate", session)}
    if answers["calibrate"]["exit_code"] == 2:
        return answers
    return answers | {
        "record": read_record(registry / _instrument(record) / f"{record}.json"),
        "again": ask("calibrate", session)["answer"]["record"],
        "verify": ask("calibration", "verify"),
        "budget": ask("calibration", "budget", record),
        "approve": ask(
            "calibration", "approve", record, "--in-force-from", "2026-04-01", "--on", "2026-04-01",
            "--checked-by", "operator two", "--reason", "frozen",
        ),
        "show": ask("calibration", "show", record, "--known-at", DAY),
    }  # fmt: skip


def _register_sessions() -> None:
    for name, files in SESSIONS.items():
        record = {"balance": "balance-r1", "standard": "cell-r1"}.get(name, "hub-r1")

        def question(place: Workplace, files: dict[str, str] = files, record: str = record) -> Any:
            answers = _entered(place, files, record)
            if record == "cell-r1":
                answers["standards"] = {
                    name: place.answer(
                        "calibration", "standard", record, "--standard", name,
                        calibrations=place.folder / "calibrations",
                    )
                    for name in ("iso376", "e74")
                }  # fmt: skip
            return answers

        golden(f"calibration/session/{name}", quick=True)(question)


_register_sessions()


@golden("calibration/second-session", quick=True)
def second_session(place: Workplace) -> Any:
    """A later session of the same instrument: history, chart, difference, withdrawal, what is due."""
    first = place.write(SESSIONS["budget"], "first") / "SESSION.toml"
    later = {name: text.replace("2026-01-05", "2026-07-06") for name, text in SESSIONS["as-found"].items()}
    second = place.write(later, "second") / "SESSION.toml"
    registry = place.folder / "calibrations"
    registry.mkdir()

    def ask(*words: object) -> dict[str, Any]:
        return place.answer(*words, calibrations=registry)

    answers = {}
    for record, session, day in (("hub-r1", first, "2026-01-06"), ("hub-r2", second, "2026-07-07")):
        answers[f"calibrate {record}"] = ask("calibrate", session)
        answers[f"approve {record}"] = ask(
            "calibration", "approve", record, "--in-force-from", day, "--on", day,
            "--checked-by", "operator two", "--recall", "12 months", "--reason", "frozen",
        )  # fmt: skip
    answers["diff"] = ask("calibration", "diff", "hub-r1", "hub-r2")
    answers["chart"] = ask("calibration", "chart", "hub")
    answers["withdraw"] = ask(
        "calibration",
        "withdraw",
        "hub-r2",
        "--on",
        "2026-08-01",
        "--reason",
        "frozen",
        "--by",
        "operator two",
    )
    answers["list"] = ask("calibration", "list", "--known-at", "2026-09-01")
    return answers


@golden("calibration/certificate")
def certificates(place: Workplace) -> Any:
    """What fills a certificate and its digital one, of the packaged record and of a session with a budget."""
    style = (TEMPLATES / "org.toml").read_text().replace("[laboratory]", '[laboratory]\ncountry = "DE"')
    folder = place.write({"org.toml": style}, "templates")
    shutil.copy(TEMPLATES / "certificate.docx", folder)
    template = folder / "certificate.docx"
    room = place.room("budget")
    _entered(room, SESSIONS["budget"], "hub-r1")
    return {
        FITTED: _certificate(place, FITTED, template, _own(folder)),
        "hub-r1": _certificate(place, "hub-r1", template, room.folder / "calibrations"),
        "m15-r2": place.packaged(
            "calibration", "certificate", "m15-r2", "--template", template, "--out", "none"
        ),
    }


def _own(folder: Path) -> Path:
    """Return the packaged records in a folder of their own: a certificate is an entry of its ledger."""
    return Path(shutil.copytree(CALIBRATIONS, folder / "calibrations"))


def _unsigned(xml: str) -> str:
    """Return a digital certificate without its proof and its line of signatures."""
    signed = r" *<dcc:identification>(?:(?!</dcc:identification>).)*Signatures of the record.*?tion>\n"
    return re.sub(
        signed, "", re.sub("<dcc:comment>.*?</dcc:comment>", "", xml, flags=re.DOTALL), flags=re.DOTALL
    )


def _certificate(place: Workplace, record: str, template: Path, registry: Path) -> dict[str, Any]:
    answer = place.answer(
        "calibration", "certificate", record, "--template", template, "--out", f"out-{record}", "--dcc",
        "--known-at", DAY, calibrations=registry,
    )  # fmt: skip
    digital = next((place.folder / f"out-{record}").glob("*.xml"), None)
    lines = [] if digital is None else _unsigned(digital.read_text()).splitlines()
    for number, line in enumerate(lines):
        if "Head of the ledger" in line:  # it has times in it
            lines[number - 2] = "      <dcc:value></dcc:value>"
    return answer | {"dcc": lines}
