"""The hand-over: one manifest of what went in and what came out, and the hash of the content."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toolkit.files import sha256_bytes, sha256_file
from toolkit.recording.marks import GENERATOR
from toolkit.report.content import ReportContent
from toolkit.report.word.filled import Filled
from toolkit.report.word.package import Template

MANIFEST = "manifest.json"
_OF_THE_DAY = ("tk:report.date",)


def content_hash(filled: Filled, template: Template) -> str:
    """Return the SHA-256 of what a report says: every printed value, cell, figure, and the template.

    Neither a .docx nor a PDF is the same byte for byte twice, so the content is hashed. The day of issue
    is left out, and so is what a run took: the same inputs give the same hash on another day. (A row of a
    table with such a value is hashed by its other values, not as a row of cells.)
    """
    passing = {*_OF_THE_DAY, *filled.of_the_run}
    printed = {
        "template": template.sha256,
        "values": [
            [entry.tag, entry.text, entry.part] for entry in filled.manifest if entry.tag not in passing
        ],
        "cells": [row for at, row in enumerate(filled.cells) if at not in filled.rows_of_the_run],
        "figures": [[tag, alt] for tag, alt in filled.figures],
        "pictures": filled.pictures,
        "contents": [[entry.text, entry.level] for entry in filled.contents.entries],
    }
    return sha256_bytes(json.dumps(printed, ensure_ascii=False, separators=(",", ":")).encode())


def manifest_json(
    provenance: Mapping[str, Any],
    content: ReportContent,
    template: Template,
    digest: str,
    outputs: Sequence[Path],
    ledger: Mapping[str, Any] | None = None,
    *,
    missing: Sequence[str] = (),
) -> str:
    """Return the manifest: inputs, calibration, software and outputs, each with its SHA-256.

    ``provenance`` holds what the caller knows: the inputs and the software; ``ledger`` is the proof of a
    document that was issued, ``missing`` are the tags that print a mark in place of a value.
    """
    manifest = {
        "generator": GENERATOR,
        "schema": 1,
        "report": content.identity,
        "issued": content.issued,
        "content_sha256": digest,
        "template": {"name": template.path.name, "sha256": template.sha256},
        "draft": bool(content.draft_reasons),
        "draft_reasons": list(content.draft_reasons),
        "signature": content.signature,
        "calibrations": [calibration.as_dict() for calibration in content.calibrations],
        "missing": list(missing),
        **provenance,
        "outputs": [
            {"name": output.name, "sha256": sha256_file(output), "bytes": output.stat().st_size}
            for output in outputs
        ],
        "ledger": ledger,
    }
    return json.dumps(manifest, ensure_ascii=False, indent=2) + "\n"
