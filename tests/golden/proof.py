"""Cases of the newest opened batch of the proof, drawn again from its seed and answered by the code."""

from __future__ import annotations

from typing import Any

from tests.golden.diagnosis import diagnosed
from tests.golden.entries import golden
from tests.golden.surface import CALIBRATIONS, enter_proof_sessions, read_proof, write_proof_case
from tests.golden.workplace import Workplace

BATCH = "3fc192dbc9b0de9d"
CHOSEN = (
    "case0033 case0084 case0088 case0091 case0020 case0027 case0049 case0058 case0075 case0077 case0095 "
    "case0004 case0005 case0042 case0047 case0089 case0112 case0028 case0035 case0124 case0069 case0078 "
    "case0018 case0068 case0115 case0046 case0016 case0021 case0024 case0048"
).split()
"""Quick ones of every mix and every kind of simulation."""


def _register_cases() -> None:
    for name in CHOSEN:

        def question(place: Workplace, name: str = name) -> Any:
            seed, truth, _ = place.once("proof", lambda _room: read_proof(BATCH))
            row = truth[name]
            case = place.folder / "case"
            write_proof_case(case, seed=seed, index=row["index"], bucket=row["bucket"])
            registry = place.folder / "calibrations"
            own = enter_proof_sessions(case, registry)
            return diagnosed(place, case / "CASE.toml", calibrations=registry if own else CALIBRATIONS)

        golden(f"proof/{name}")(question)


_register_cases()
