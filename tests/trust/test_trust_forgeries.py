"""Every forgery of the table is refused, by a refusal and not by a fault: none is accepted."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

import pytest
from cryptography.hazmat.primitives.serialization import PublicFormat

from tests.trust.forgeries import anchors, documents, elsewhere, keys, ledger, places, requests
from tests.trust.forgeries.changes import Forgery
from tests.trust.forgeries.laboratory import KEYS, believed, forget, laboratory
from tests.trust.seal.seal_factory import sealed_pdf, sealed_xml, trust
from toolkit.trust.people import NAMESPACE
from toolkit.trust.seal.pdf import check_pdf
from toolkit.trust.seal.xml import check_xml
from toolkit.trust.ssh import PublicKey

TABLES = {
    "ledger": (ledger, 900), "keys": (keys, 80), "anchors": (anchors, 100), "requests": (requests, 150),
    "documents": (documents, 100), "elsewhere": (elsewhere, 60), "places": (places, 25),
}  # fmt: skip
"""Each table, and the least number of forgeries in it: a generator that went silent would prove nothing."""


@pytest.fixture(scope="module", autouse=True)
def _laboratory() -> Iterator[None]:
    yield
    forget()


WHOLE = pytest.mark.campaign(
    "every forgery of a kind: a third of each kind, spread over its places, is tried in every run"
)


def spread(table: list[Forgery]) -> list[Forgery]:
    """Return every third forgery of each kind, from its first on."""
    kinds: dict[str, list[Forgery]] = {}
    for forgery in table:
        kinds.setdefault(forgery.kind, []).append(forgery)
    return [forgery for alike in kinds.values() for forgery in alike[::3]]


@pytest.mark.parametrize("part", [True, pytest.param(False, marks=WHOLE)], ids=["part", "whole"])
@pytest.mark.parametrize("name", TABLES)
def test_no_forgery_is_accepted(name: str, part: bool, capsys: pytest.CaptureFixture[str]) -> None:
    module, least = TABLES[name]
    table: list[Forgery] = list(module.forgeries())
    assert len(table) >= least
    table = spread(table) if part else table
    started = time.perf_counter()
    accepted = [f"{forgery.kind}: {forgery.what}" for forgery in table if forgery.accepted()]
    seconds = time.perf_counter() - started
    counts = Counter(forgery.kind for forgery in table)
    with capsys.disabled():
        rows = ", ".join(f"{kind} {count}" for kind, count in sorted(counts.items()))
        print(f"\n{name}: {len(table)} forgeries in {seconds:.1f} s, {len(accepted)} accepted: {rows}")  # noqa: T201
    assert accepted == []


def test_what_is_honest_is_accepted() -> None:
    with laboratory() as home:
        assert believed(home)
        assert requests.entered(home, requests.request_of(home).signed(KEYS["dora"])[0].text)
        assert believed(home)
    assert check_pdf(sealed_pdf(), trust()).signature == "valid"
    assert check_xml(sealed_xml(), trust()).signature == "valid"
    assert documents._dcc_taken({})
    assert elsewhere._enrolled_as("zoe", "Zoe Example")
    assert elsewhere._of_purpose(NAMESPACE, stated=True)
    assert keys._enrolled(lambda: keys._point(PublicFormat.UncompressedPoint))
    assert keys._enrolled(lambda: PublicKey("ssh-rsa", keys._rsa_blob(3072)).line)
