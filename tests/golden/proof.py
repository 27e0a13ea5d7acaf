"""Cases of the newest opened batch of the proof, drawn again from its seed and answered by the code."""

from __future__ import annotations

from typing import Any

from tests.golden.diagnosis import diagnosed
from tests.golden.entries import golden
from tests.golden.surface import CALIBRATIONS, enter_proof_sessions, read_proof, write_proof_case
from tests.golden.workplace import Workplace

BATCH = "252a86e074e9b1d9"
CHOSEN = (
    "case0235 case0074 case0153 case0103 case0133 case0327 case0397 case0079 case0313 case0130 case0307 "
    "case0298 case0237 case0048 case0044 case0047 case0268 case0286 case0260 case0310 case0343"
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
