"""A certificate's content, template and digital twin; the record is that of a session of known truth."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import SHARED_DATA
from toolkit.calibration.registry import approval, life
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError, RecordError, RegistryError
from toolkit.report.certificate.collect import collect
from toolkit.report.certificate.content import GAP, build_content
from toolkit.report.certificate.dcc import build_dcc
from toolkit.report.style import Style

CHECKOUT = Path(__file__).resolve().parents[3]
DAY, LATER = dt.date(2026, 3, 1), dt.date(2026, 7, 1)
STYLE = Style(laboratory="Bench laboratory", country="US")
FULL = (
    '[certificate]\nnumber = "CAL-17"\ncustomer = "Customer & Co <x>"\naddress = "1 Drum Road"\n'
    'place = "bay 3"\nmethod = "dead weights"\ndecision_rule = "guard_band"\ninterval = "12 months"\n{}\n'
    '[reference]\nstandard = "force machine 1"\ncertificate = "FM-1"\ndue = 2026-12-31\n'
    '[reference.uncertainty]\nFY = {{ U = 0.02, k = 2, unit = "lbf" }}\n'
    'MZ = {{ U = 0.02, k = 2, unit = "lbf*ft" }}\n'
    '[cells.A]\nserial = "SA1"\n[cells.B]\nserial = "SB2"\n'
)


def registry_of(folder: Path, more: str = FULL.format(""), *, approved: bool = True) -> Registry:
    rng = np.random.default_rng(5)
    for name, rows, tail in (("loads", 60, True), ("check", 6, False)):
        s = rng.uniform(-2, 2, (rows, 2))
        loads = s @ np.array([[100.0, 3.0], [20.0, -50.0]]) + [1.5, -2.0] + rng.normal(0, 0.01, (rows, 2))
        lines = ["A [mV/V],B [mV/V],FY [lbf],MZ [lbf*ft]" + (",run,direction" if tail else "")]
        for i, row in enumerate(np.column_stack([0.98 * s if not tail else s, loads]).tolist()):
            if not tail:
                row[:2] = s[i].tolist()
            lines.append(
                ",".join(map(repr, row)) + (f",{1 + i // 20},{'up' if i % 2 else 'down'}" if tail else "")
            )
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    (folder / "SESSION.toml").write_text(
        'schema = 1\ninstrument = "pair"\ndate = 2026-02-01\noperator = "A"\nindications = ["A", "B"]\n'
        'temperature = { value = 20.5, unit = "degC" }\nloads = ["FY", "MZ"]\ndata = "loads.csv"\n'
        'check = "check.csv"\n'
        # Apart from the rows, read to half a percent: FY = 100 A + 20 B + 1.5, MZ = 3 A - 50 B - 2.
        'polarity = [{ load = "FY", value = { value = 151, unit = "lbf" }, indications = { '
        'A = { value = 1.3, unit = "mV/V" }, B = { value = 1.0, unit = "mV/V" } } }, '
        '{ load = "MZ", value = { value = -48, unit = "lbf*ft" }, indications = { '
        'A = { value = 1.3, unit = "mV/V" }, B = { value = 1.0, unit = "mV/V" } } }]\n' + more
    )
    (folder / "cal").mkdir()
    registry = Registry(folder / "cal")
    calibrate(folder / "SESSION.toml", registry)
    if approved:
        done = approve(
            registry, "pair-r1", in_force_from=dt.date(2026, 2, 2), checked_by="B", approved_by="C",
            known_on=dt.date(2026, 2, 2), reason="late",
        )  # fmt: skip
        assert done.done, done.findings
    return registry


def adjusted(folder: Path) -> Registry:
    """Return a registry whose pair came in with indications 0.5 % too large (r2) and was adjusted (r3)."""
    registry = registry_of(folder)
    session, columns = (folder / "SESSION.toml").read_text(), (folder / "loads.csv").read_text().splitlines()
    for phase, drift, U in (("as_found", 1.005, 0.5), ("as_left", 1.0, 0.02)):
        there = folder / phase
        there.mkdir()
        rows = [line.split(",") for line in columns[1:]]
        for row in rows:
            row[:2] = [repr(drift * float(cell)) for cell in row[:2]]
        (there / "loads.csv").write_text("\n".join([columns[0], *(",".join(row) for row in rows)]) + "\n")
        text = session.replace("2026-02-01", "2026-06-01").replace("CAL-17", "CAL-18")
        text = text.replace('check = "check.csv"\n', "")
        text = text.replace('data = "loads.csv"', f'data = "loads.csv"\nphase = "{phase}"')
        (there / "SESSION.toml").write_text(text.replace("U = 0.02", f"U = {U}"))
        calibrate(there / "SESSION.toml", registry)
    approve(
        registry, "pair-r3", in_force_from=dt.date(2026, 6, 2), checked_by="B", known_on=LATER, reason="late"
    )
    return registry


def test_as_found_and_as_left_have_each_their_own_uncertainty(tmp_path: Path) -> None:
    made = collect(adjusted(tmp_path), "pair-r3", STYLE, issued=LATER)
    # What a reference of U = 0.5 found and one of U = 0.02 left: each rules the budget of its own session.
    one = next(one for one in made.loads if one.load == "FY")
    told = one.adjustment
    assert told is not None
    assert told.left is not None
    # The equation has an intercept of 1.5 lbf, which does not drift.
    assert told.as_found == pytest.approx(0.005 * (told.found.at - 1.5), abs=0.05)
    assert told.found.U == pytest.approx(0.5, rel=0.05)
    assert told.left.U < 0.05
    row = build_content(made, STYLE).tables["adjustment"].rows[0]
    # k = 1.96 for about 95 % and large dof, u = 0.5 / 2.
    assert (row[0], row[-2]) == ("FY", "0.49")
    newtons = 0.5 * 0.45359237 * 9.80665
    found = re.search(
        r"basic_beforeAdjustment.*?valueExpandedMU>([^<]+)<", build_dcc(made).decode(), flags=re.DOTALL
    )
    assert found
    assert float(found[1]) == pytest.approx(newtons, rel=0.05)
    # The as-found session is told here, under the number that both of them state.
    assert "certificate-number" not in {one.rule for one in made.findings}


def test_a_decimal_comma_stands_in_every_number_and_in_no_name(tmp_path: Path) -> None:
    more = FULL.format("").replace('serial = "SA1"', 'serial = "12.5"')
    made = collect(registry_of(tmp_path, more), "pair-r1", STYLE, issued=DAY)
    content = build_content(made, replace(STYLE, decimal_comma=True))
    texts = {
        name: str(content.values[f"certificate.{name}"].value) for name in ("temperature", "traceability")
    }
    assert texts["temperature"] == "20,5 °C"
    assert "U = 0,02 lbf, k = 2" in texts["traceability"]
    assert "tolerance 0," in str(content.values["certificate.conformity"].value)
    rule = str(content.values["certificate.decision_rule"].value)
    # The clause of the guide is no number.
    assert "2,5 %" in rule
    assert "4.2.3" in rule
    cells = content.tables["cells"].rows[0]
    assert cells[1] == "12.5"
    assert "," in str(cells[3])
    assert all(plot.decimal_comma for plot in content.plots.values())
    # The digital certificate has its own rules.
    assert "U = 0.02 lbf" in build_dcc(made).decode()


def test_the_items_of_17025_are_there(tmp_path: Path) -> None:
    made = collect(registry_of(tmp_path), "pair-r1", STYLE, issued=DAY)
    assert (made.id, made.gaps, made.draft) == ("CAL-17", (), False)
    values = build_content(made, STYLE).values
    assert not [path for path, value in values.items() if value.value == GAP]
    said = {
        name: str(values[f"certificate.{name}"].value) for name in ("traceability", "temperature", "customer")
    }
    assert "force machine 1" in said["traceability"]
    assert "FM-1" in said["traceability"]
    assert said["temperature"] == "20.5 °C"
    signed = [values[f"certificate.{name}"].value for name in ("entered_by", "checked_by", "approved_by")]
    assert signed == ["A", "B", "C"]


def test_what_nobody_stated_is_a_visible_gap(tmp_path: Path) -> None:
    made = collect(registry_of(tmp_path, ""), "pair-r1", Style(), issued=DAY)
    assert {"customer", "reference standard", "place of the calibration"} <= set(made.gaps)
    assert {one.rule for one in made.findings if one.level == "warning"} == {"certificate-gap"}
    values = build_content(made).values
    assert values["certificate.customer"].value == GAP
    assert "No conformity is stated" in str(values["certificate.conformity"].value)
    assert {line.verdict for one in made.loads for line in one.checks} == {None}


def test_u_has_two_digits_and_the_value_its_places(tmp_path: Path) -> None:
    content = build_content(collect(registry_of(tmp_path), "pair-r1", STYLE, issued=DAY), STYLE)
    table = content.tables["uncertainty"]
    at = [column.name for column in table.columns]
    for row in table.rows:
        told = dict(zip(at, map(str, row), strict=True))
        digits = told["U"].replace(".", "").strip("0")
        assert 1 <= len(digits) <= 2
        places = len(told["U"].partition(".")[2])
        assert len(told["at"].partition(".")[2]) == places
        assert 1.9 < float(told["k"]) < 4
        assert told["p"] == "95"


@pytest.mark.parametrize(("agreed", "printed"), [("interval_agreed = true", True), ("", False)])
def test_an_interval_stands_only_where_it_was_agreed(tmp_path: Path, agreed: str, printed: bool) -> None:
    content = build_content(collect(registry_of(tmp_path, FULL.format(agreed)), "pair-r1", STYLE, issued=DAY))
    words = " ".join(str(value.value) for value in content.values.values())
    assert ("12 months" in words) is printed
    assert content.conditions["interval_agreed"] is printed
    assert "2026-12-31" not in words  # nor the reference's own last day


def test_an_amended_certificate_has_its_own_id_and_names_the_other(tmp_path: Path) -> None:
    registry = registry_of(tmp_path)
    one = collect(registry, "pair-r1", STYLE, issued=DAY, replaces="CAL-17", amendment="a name was wrong")
    two = collect(registry, "pair-r1", STYLE, issued=DAY, replaces="CAL-17-A1", amendment="again")
    assert (one.id, two.id) == ("CAL-17-A1", "CAL-17-A2")
    assert (one.replaces, one.amendment) == ("CAL-17", "a name was wrong")
    with pytest.raises(ConfigError, match="amended"):
        collect(registry, "pair-r1", STYLE, issued=DAY, replaces="CAL-17")


def test_a_candidate_has_a_draft_at_most(tmp_path: Path) -> None:
    registry = registry_of(tmp_path, approved=False)
    with pytest.raises(RecordError) as caught:
        collect(registry, "pair-r1", STYLE, issued=DAY)
    assert caught.value.rule == "certificate-candidate"
    made = collect(registry, "pair-r1", STYLE, issued=DAY, draft=True)
    assert made.draft
    assert build_content(made).marks[0][1].startswith("DRAFT")


def test_no_certificate_is_of_a_day_to_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    registry = registry_of(tmp_path)
    late = dt.datetime.now(tz=dt.UTC) + dt.timedelta(days=100)
    with pytest.raises(RegistryError) as caught:
        collect(registry, "pair-r1", STYLE, issued=late.date())
    assert caught.value.rule == "time"
    # Another record is approved by a computer whose clock is fast: the day of its decision is none of issue.
    session = tmp_path / "SESSION.toml"
    session.write_text(session.read_text().replace("date = 2026-02-01", "date = 2026-02-03"))
    calibrate(session, registry)
    with monkeypatch.context() as fast:
        fast.setattr(approval, "now", lambda: late.strftime("%Y-%m-%dT%H:%M:%SZ"))
        fast.setattr(life, "check_begun", lambda *_words: None)
        assert approve(
            registry, "pair-r2", in_force_from=dt.date(2026, 2, 4), checked_by="B", reason="late",
            known_on=late.date(),
        ).done  # fmt: skip
    made = collect(registry, "pair-r1", STYLE)
    assert made.issued == registry.today()
    assert [finding.where for finding in made.findings if finding.rule == "ledger-time"] == ["pair"]
    with pytest.raises(RecordError) as unborn:
        collect(registry, "pair-r2", STYLE)
    assert unborn.value.rule == "certificate-candidate"


def test_a_withdrawn_record_is_refused_and_an_earlier_paper_says_so(tmp_path: Path) -> None:
    registry = registry_of(tmp_path)
    withdraw(registry, "pair-r1", on=dt.date(2026, 4, 1), void_from=None, reason="cell dropped", by="B")
    with pytest.raises(RecordError) as caught:
        collect(registry, "pair-r1", STYLE, issued=dt.date(2026, 4, 2))
    assert caught.value.rule == "certificate-withdrawn"
    assert "cell dropped" in str(collect(registry, "pair-r1", STYLE, issued=DAY).withdrawn)


def test_a_legacy_import_has_none() -> None:
    with pytest.raises(RecordError) as caught:
        collect(Registry(CHECKOUT / "calibrations"), "m15-r2", STYLE)
    assert caught.value.rule == "certificate-unverified"


def test_the_dcc_is_deterministic_and_needs_a_country(tmp_path: Path) -> None:
    registry = registry_of(tmp_path)
    made = collect(registry, "pair-r1", STYLE, issued=DAY)
    assert build_dcc(made) == build_dcc(collect(registry, "pair-r1", STYLE, issued=DAY))
    with pytest.raises(ConfigError) as caught:
        build_dcc(collect(registry, "pair-r1", Style(), issued=DAY))
    assert caught.value.rule == "certificate-country"


def test_the_dcc_converts_to_newtons(tmp_path: Path) -> None:
    made = collect(registry_of(tmp_path), "pair-r1", STYLE, issued=DAY)
    text = build_dcc(made).decode()
    # 1 lbf = 0.45359237 kg x 9.80665 m/s^2, exactly; the truth of the session is 100 lbf a mV/V.
    values = [float(v) for v in re.findall(r"<si:value>([^<]+)</si:value>\s*<si:unit>\\newton\\volt", text)]
    assert values[0] == pytest.approx(100 * 0.45359237 * 9.80665, rel=1e-3)
    assert "|lbf" in text
    assert "<dcc:conformityXMLList>pass pass pass pass pass pass</dcc:conformityXMLList>" in text


# The schema's own examples write \\per; dsiUnits reads it and advises negative powers.
@pytest.mark.filterwarnings("ignore:The dsi string contains the token")
@pytest.mark.skipif(not (SHARED_DATA / "dcc_schema").is_dir(), reason="the DCC schema is not here")
@pytest.mark.parametrize(
    "make",
    [
        lambda folder: (registry_of(folder, ""), "pair-r1"),
        lambda folder: (registry_of(folder, FULL.format("interval_agreed = true")), "pair-r1"),
        lambda folder: (adjusted(folder), "pair-r3"),
    ],
    ids=["gaps", "full", "adjusted"],
)
def test_the_dcc_passes_schema_schematron_and_units(
    tmp_path: Path, make: Callable[[Path], tuple[Registry, str]]
) -> None:
    dsi_unit = pytest.importorskip("dsi_unit")
    saxonche = pytest.importorskip("saxonche")
    from lxml import etree

    registry, record_id = make(tmp_path)
    made = collect(
        registry,
        record_id,
        STYLE,
        issued=LATER,
        replaces="OLD-1",
        amendment="a <reason> & more",
    )
    path = tmp_path / "dcc.xml"
    path.write_bytes(build_dcc(made))
    tree = etree.parse(path)
    schema = etree.XMLSchema(etree.parse(SHARED_DATA / "dcc_schema" / "dcc" / "v3.3.0" / "dcc.xsd"))
    assert schema.validate(tree), schema.error_log
    with saxonche.PySaxonProcessor(license=False) as processor:
        rules = processor.new_xslt30_processor().compile_stylesheet(
            stylesheet_file=str(SHARED_DATA / "dcc_schema" / "schematron" / "dcc.svrl")
        )
        answer = etree.fromstring(rules.transform_to_string(source_file=str(path)).encode())
    space = "{http://purl.oclc.org/dsdl/svrl}"
    said = list(answer.iter(f"{space}successful-report", f"{space}failed-assert"))
    assert [" ".join("".join(m.itertext()).split()) for m in said if m.get("role") == "error"] == []
    units = {e.text for e in tree.iter("{https://ptb.de/si}unit", "{https://ptb.de/si}unitXMLList")}
    assert units
    assert all(dsi_unit.DsiUnit(text).valid for text in units)
