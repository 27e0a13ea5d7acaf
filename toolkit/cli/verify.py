"""`toolkit verify FILE...`: whether documents are what was issued, by whom, and whether they still hold."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import Output, RegistryOptions

NAME = "verify"


@answers("toolkit.lab.signatures.verification:VerifyForms")
def command(
    files: Annotated[
        list[Path], "PDF, DCC (.xml), manifest.json, Word file, record (.json), ledger, proof.", ARGUMENT
    ],
    trusted: Annotated[
        list[Path] | None,
        "Trust the certificates of this file too; may be repeated.",
        Mark(names=("--trust",)),
    ] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Tell of each document who issued it, when, over what, and whether it still holds; offline.

    Trusted are the certificates in trust/certificates and trust/laboratory.pem of the home, and those of
    --trust. Exit code 0: all hold; 1: one is unsigned, of an unknown issuer, or holds no longer; 2: one was
    changed after it was sealed, or cannot be read.

    Example: toolkit verify certificate.pdf certificate.xml
    """
    from functools import partial

    from toolkit.declared import json_value
    from toolkit.lab.home import registry_if_any
    from toolkit.lab.signatures.proofs import registry_ledger
    from toolkit.lab.signatures.sealing import home_trust
    from toolkit.lab.signatures.verification import verify_file
    from toolkit.trust.seal.x509 import with_files

    trust = with_files(home_trust(place.home), trusted or [])
    ledger = registry_ledger(partial(registry_if_any, place.calibrations, place.home))
    verdicts = [verify_file(path, trust, ledger=ledger) for path in files]
    rows = [json_value(verdict) for verdict in verdicts]
    payload = {**(rows[0] if len(rows) == 1 else {}), "files": rows}
    output.answer(payload, "\n".join(verdict.line for verdict in verdicts))
    return max(verdict.code for verdict in verdicts)
