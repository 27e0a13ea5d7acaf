"""Signs: the machine definition and polarity readings, without any history and against it."""

from __future__ import annotations

import datetime as dt
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import (
    CELLS,
    LOADS,
    SENSITIVITY,
    UNITS,
    ZERO,
    hub_data,
    polarity_text,
)
from tests.calibration.registry.test_candidate_legacy import GOOD
from tests.calibration.virtual_factory import PACKAGED, Change, columns, failed, judged, rules, write_virtual
from toolkit.calibration.registry.approval import Decision, approve, withdraw
from toolkit.calibration.registry.candidate import calibrate, import_legacy
from toolkit.calibration.registry.judgement import judge, machine_of
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError, UnitError
from toolkit.machine import load_machine

PROJECT = Registry(Path(__file__).resolve().parents[3] / "calibrations")


def swapped(text: str) -> str:
    return text.replace("D51 [", "DX [").replace("D52 [", "D51 [").replace("DX [", "D52 [")


def serials(**new: str) -> Change:
    def change(text: str) -> str:
        for name, serial in new.items():
            text = text.replace(
                f'[cells.{name}]\nserial = "VM15-{name}"', f'[cells.{name}]\nserial = "{serial}"'
            )
        return text

    return change


@pytest.fixture
def empty(tmp_path: Path) -> Registry:
    (tmp_path / "empty").mkdir()
    return Registry(tmp_path / "empty")


@pytest.fixture
def used(tmp_path: Path) -> Registry:
    shutil.copytree(PACKAGED, tmp_path / "cal" / "m15-virtual")
    return Registry(tmp_path / "cal")


def test_the_machine_has_the_published_signs() -> None:
    # Thesis, section 4.1; the overturning levers of the drawing.
    machine = load_machine("m15")
    signs = {one.name: dict(one.signs) for one in machine.cells}
    assert signs == {
        "D51": {"FY": 1, "MZ": -1, "MX": 1}, "D52": {"FY": 1, "MZ": 1, "MX": 1}, "E5": {"FY": 1, "MX": -1},
    }  # fmt: skip
    assert {n: np.sign(lever) for n, lever in machine.layout.overturning_lever_m} == {
        n: s["MX"] for n, s in signs.items()
    }
    assert all("thesis 4.1" in one.source for one in machine.cells)
    assert load_machine("m15-virtual").cells == machine.cells


def test_a_first_session_as_it_should_be_is_approved_by_the_machine(empty: Registry, tmp_path: Path) -> None:
    made, decision = judged(empty, write_virtual(tmp_path / "s"))
    assert rules(made) == rules(made, "note") == set()
    assert decision.done
    assert "signs as machine m15-virtual, version 1, states them: FY D51" in decision.evidence[0]


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (columns(E5=-1.0), {"FY, E5", "MX, E5"}),
        (columns(D51=-1.0), {"FY, D51", "MZ, D51", "MX, D51"}),
        (columns(FY=-1.0), {"FY, D51", "FY, D52", "FY, E5"}),
        (swapped, {"MZ, D51", "MZ, D52"}),
    ],
)
def test_a_first_session_with_a_wrong_sign_or_order_is_refused(
    empty: Registry, tmp_path: Path, change: Change, where: set[str]
) -> None:
    made, decision = judged(empty, write_virtual(tmp_path / "s", change))
    assert "polarity" in rules(made)
    assert {one.where for one in decision.failed if one.rule == "polarity"} == where
    assert empty.status(made.record.id).state == "candidate"


def test_a_new_serial_does_not_hide_a_sign(used: Registry, tmp_path: Path) -> None:
    path = write_virtual(tmp_path / "s", columns(E5=-1.0), session=serials(E5="NEW"))
    _, decision = judged(used, path, reason="E5 was exchanged")
    assert {"sign", "polarity"} <= failed(decision)


def test_a_cell_that_hardly_moves_does_not_hide_its_sign(empty: Registry, tmp_path: Path) -> None:
    # Of two cells side by side the second is loaded in full once, and then by a thousandth with its sign
    # turned: that moves FY by less than the tolerance of its session.
    def session(name: str, share: float, tail: str) -> Path:
        rng = np.random.default_rng(7)
        folder = tmp_path / name
        folder.mkdir()
        for file, rows in (("loads", 40), ("check", 8)):
            a, b = rng.uniform(-1, 1, rows), abs(share) * rng.uniform(-1, 1, rows)
            force = 500 * a + np.sign(share) * 300 * b
            lines = ["A [mV/V],B [mV/V],FY [N]" + (",run,direction" if file == "loads" else "")]
            for i, row in enumerate(np.column_stack([a, b, force + rng.normal(0, 1e-3, rows)]).tolist()):
                more = [str(i // 20 + 1), "up"] if file == "loads" else []
                lines.append(",".join([*(f"{x:.7f}" for x in row), *more]))
            (folder / f"{file}.csv").write_text("\n".join(lines) + "\n")
        (folder / "SESSION.toml").write_text(
            'schema = 1\ninstrument = "pair"\ndate = 2026-01-05\noperator = "A"\nloads = ["FY"]\n'
            'indications = ["A", "B"]\ndata = "loads.csv"\ncheck = "check.csv"\n' + tail
        )
        return folder / "SESSION.toml"

    known = (
        '[[polarity]]\nload = "FY"\nvalue = { value = 403, unit = "N" }\n'
        'indications = { A = { value = 0.5, unit = "mV/V" }, B = { value = 0.5, unit = "mV/V" } }\n'
    )
    assert approved(empty, session("first", 1.0, known)).done
    assert failed(approved(empty, session("small", -1e-3, ""))) == {"sign", "range"}


def test_a_withdrawn_history_does_not_hide_a_sign(used: Registry, tmp_path: Path) -> None:
    withdraw(used, "m15-virtual-r1", on=dt.date(2026, 11, 2), reason="to make room", by="B")
    _, decision = judged(used, write_virtual(tmp_path / "s", columns(E5=-1.0)))
    assert failed(decision) == {"polarity"}


def test_two_serials_that_are_exchanged_are_named(used: Registry, tmp_path: Path) -> None:
    path = write_virtual(tmp_path / "s", session=serials(D51="VM15-D52", D52="VM15-D51"))
    made, decision = judged(used, path)
    (told,) = [one.message for one in made.findings if (one.rule, one.where) == ("serial", "D51")]
    assert "now VM15-D52, which stood at D52 in m15-virtual-r1" in told
    assert failed(decision) == {"replacement"}


def test_one_serial_for_two_cells_is_refused(used: Registry, tmp_path: Path) -> None:
    path = write_virtual(tmp_path / "s", session=serials(D51="VM15-D52"))
    _, decision = judged(used, path, reason="exchanged")
    assert failed(decision) == {"serial"}


def test_a_turned_cell_needs_a_new_definition_and_then_passes(used: Registry, tmp_path: Path) -> None:
    source = Path(__file__).resolve().parents[3] / "toolkit" / "machine" / "m15.toml"
    text = source.read_text().replace('name = "m15"', 'name = "m15-virtual"', 1)
    text = text.replace("polarity = { FY = 1, MX = -1 }", "polarity = { FY = -1, MX = 1 }")
    turned = tmp_path / "turned.toml"
    turned.write_text(text)
    path = write_virtual(tmp_path / "s", columns(E5=-1.0), session=serials(E5="NEW"))
    made = calibrate(path, used, machine=str(turned))
    day = dt.date(2026, 11, 1)
    decision = approve(
        used, made.record.id, in_force_from=day, checked_by="Z", reason="E5 mounted the other way round",
        machine=str(turned),
    )  # fmt: skip
    assert decision.done, decision.findings
    assert any("the sign changed" in text and "its sign is confirmed" in text for text in decision.evidence)
    with pytest.raises(ConfigError):
        machine_of("m15", str(turned))


@pytest.mark.parametrize(
    ("entry", "key"),
    [
        ('name = "D53"\npolarity = { FY = 1 }\nsource = "x"', "cell[1].name"),
        ('name = "D51"\npolarity = { FY = 2 }\nsource = "x"', "cell[1].polarity.FY"),
        ('name = "D51"\npolarity = { FY = true }\nsource = "x"', "cell[1].polarity.FY"),
        ('name = "D51"\npolarity = {}\nsource = "x"', "cell[1].polarity"),
        ('name = "D51"\npolarity = { FY = 1 }', "cell[1].source"),
        ('name = "D51"\npolarity = { FY = 1 }\nsource = "x"\nsense = 1', "cell[1]"),
    ],
)
def test_a_polarity_that_cannot_be(tmp_path: Path, entry: str, key: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(f'name = "own"\nextends = "m15"\n[[cell]]\n{entry}\n')
    with pytest.raises(ConfigError) as caught:
        load_machine(str(path))
    assert caught.value.where == f"{path}: {key}"


# A rig that no machine definition knows: readings.

Make = Callable[..., Path]


def approved(registry: Registry, path: Path, **more: object) -> Decision:
    made = calibrate(path, registry)
    return approve(registry, made.record.id, in_force_from=dt.date(2026, 2, 1), checked_by="B", **more)  # type: ignore[arg-type]


def test_without_history_machine_or_reading_nothing_is_approved(empty: Registry, make_session: Make) -> None:
    path = make_session(polarity="-")
    made = calibrate(path, empty)
    assert rules(made, "note") == {"polarity-reading"}
    decision = approve(empty, "hub-r1", in_force_from=dt.date(2026, 2, 1), checked_by="B")
    assert failed(decision) == {"polarity-reading"}
    # What the session only asks for refuses the approval: no script may take that for one.
    assert {finding.level for finding in decision.findings} == {"error"}
    for name in (*LOADS, *CELLS):
        assert name in decision.failed[0].message


def test_a_new_cell_of_a_rig_needs_a_reading_too(empty: Registry, make_session: Make) -> None:
    assert approved(empty, make_session(tail='[cells.E5]\nserial = "1"\n')).done
    path = make_session(
        hub_data(60, 4), name="new", polarity="-", tail='[cells.E5]\nserial = "2"\nreplacement = "broken"\n'
    )
    made = calibrate(path, empty)
    decision = approve(empty, made.record.id, in_force_from=dt.date(2026, 2, 2), checked_by="B")
    assert failed(decision) == {"polarity-reading"}
    assert "nothing confirms the sign of indication E5:" in decision.failed[0].message


def test_another_kind_of_unit_needs_a_reading_too(empty: Registry, make_session: Make) -> None:
    assert approved(empty, make_session()).done

    def session(name: str, turned: float) -> Path:
        path = make_session(hub_data(60, 4), name=name, polarity="-")
        for file in (path.parent / "loads.csv", path.parent / "check.csv"):
            header, *rows = file.read_text().strip().split("\n")
            cells = [row.split(",") for row in rows]
            for row in cells:
                row[2] = repr(turned * 5e4 * float(row[2]))
            body = [",".join(row) for row in cells]
            file.write_text("\n".join([header.replace("E5 [mV/V]", "E5 [count]"), *body]) + "\n")
        return path

    for name, turned, expected in (("counts", 1.0, set()), ("turned", -1.0, {"sign"})):
        made = calibrate(session(name, turned), empty)
        (told,) = [one.message for one in made.findings if one.rule == "unit-changed"]
        assert "different kinds of quantity" in told
        decision = approve(empty, made.record.id, in_force_from=dt.date(2026, 2, 2), checked_by="B")
        assert failed(decision) == {*expected, *(() if expected else ("polarity-reading",))}


def test_a_reading_may_come_in_a_file_of_its_own(empty: Registry, make_session: Make, tmp_path: Path) -> None:
    file = tmp_path / "readings.toml"
    file.write_text(f"polarity = {polarity_text()}\n")
    decision = approved(empty, make_session(polarity="-"), polarity=file)
    assert decision.done, decision.findings
    (entry,) = [e for e in empty.ledger("hub").entries if e.event == "approved"]
    assert (
        sum(text.startswith("polarity reading: 399") or "polarity reading" in text for text in entry.evidence)
        == 3
    )
    # Once approved, its signs are confirmed: another date asks for no other reading.
    again = approve(
        empty, "hub-r1", in_force_from=dt.date(2026, 1, 10), checked_by="B", reason="its first use"
    )
    assert again.done


@pytest.mark.parametrize("flipped", [*CELLS, *LOADS])
def test_a_reading_finds_every_sign(empty: Registry, make_session: Make, flipped: str) -> None:
    at = (*CELLS, *LOADS).index(flipped)
    values, check = hub_data(60, 1), hub_data(9, 2)
    values[:, at] *= -1
    check[:, at] *= -1
    decision = approved(empty, make_session(values, check_rows=check))
    assert failed(decision) == {"polarity-reading"}


def test_a_reading_finds_a_unit_that_slipped(empty: Registry, make_session: Make) -> None:
    path = make_session()
    for name in ("loads.csv", "check.csv"):
        file = path.parent / name
        file.write_text(file.read_text().replace("FY [lbf]", "FY [N]"))
    decision = approved(empty, path)
    assert failed(decision) == {"polarity-reading"}
    assert any("misses the reading" in one.message for one in decision.failed)


def reading(load: str, value: float, cells: list[float], more: str = "") -> str:
    inner = ", ".join(f'{n} = {{ value = {x!r}, unit = "mV/V" }}' for n, x in zip(CELLS, cells, strict=True))
    return (
        f'{{ load = "{load}", value = {{ value = {value!r}, unit = "{UNITS[load]}" }}, '
        f"indications = {{ {inner} }}{more} }}"
    )


def test_a_row_of_the_session_is_no_reading(empty: Registry, make_session: Make) -> None:
    for rows in (hub_data(60, 1).round(7), hub_data(9, 2).round(7)):
        row = rows[np.abs(rows[:, 3]).argmax()]
        text = f"[{reading('FY', float(row[3]), row[:3].tolist())}]"
        decision = approved(empty, make_session(polarity=text, name=f"of{len(rows)}"))
        assert any("equals a row of the session" in one.message for one in decision.failed)


def test_a_small_load_tells_no_direction(empty: Registry, make_session: Make) -> None:
    cells = (SENSITIVITY[:, 0] * 20 + ZERO).round(6).tolist()
    decision = approved(empty, make_session(polarity=f"[{reading('FY', 20.0, cells)}]"))
    assert any("too small to tell a direction" in one.message for one in decision.failed)


def test_a_tared_reading_states_its_zero(empty: Registry, make_session: Make) -> None:
    # Read after the amplifier drifted by ten times its zero: without the stated zero it misses.
    zero = (11 * ZERO).round(6).tolist()
    more = ", zero = { " + ", ".join(
        f'{n} = {{ value = {x!r}, unit = "mV/V" }}' for n, x in zip(CELLS, zero, strict=True)
    ) + " }"  # fmt: skip
    texts = {"": [], more: []}
    for at, (load, value) in enumerate((("FY", 400.0), ("MZ", 80.0), ("MX", 120.0))):
        cells = (SENSITIVITY[:, at] * value + 11 * ZERO).round(6).tolist()
        for end, found in texts.items():
            found.append(reading(load, value, cells, end))
    without, stated = (f"[{', '.join(found)}]" for found in texts.values())
    assert failed(approved(empty, make_session(polarity=without, name="without"))) == {"polarity-reading"}
    assert approved(empty, make_session(polarity=stated, name="stated")).done


@pytest.mark.parametrize(
    "text",
    [
        '[{ load = "FZ", value = { value = 1, unit = "lbf" } }]',
        '[{ load = "FY", value = 400 }]',
        '[{ load = "FY", value = { value = 0, unit = "lbf" }, indications = {} }]',
        '[{ load = "FY", value = { value = 400, unit = "lbf" }, indications = { D51 = 0.8 } }]',
        '[{ load = "FY", value = { value = 400, unit = "lbf*ft" }, indications = {} }]',
        '[{ load = "FY", value = { value = 400, unit = "lbf" }, '
        'indications = { D51 = { value = 1, unit = "mV/V" } } }]',
        f"[{reading('FY', 400.0, [0.8, 1.0, 0.4], ', tolerance = 0.9')}]",
        f"[{reading('FY', 400.0, [0.8, 1.0, 0.4], ', sign = 1')}]",
        '"up"',
    ],
)
def test_a_reading_that_cannot_be_used_is_refused_when_the_session_is_read(
    empty: Registry, make_session: Make, text: str
) -> None:
    with pytest.raises((ConfigError, UnitError)) as caught:
        calibrate(make_session(polarity=text), empty)
    assert caught.value.exit_code == 2
    assert not list(empty.folder.iterdir())


def test_legacy_records_are_held_against_the_machine() -> None:
    # m15-r1 is the old calibration with E5 negative, m15-r2 the published one.
    machine = load_machine("m15")
    assert judge(PROJECT.load("m15-r2"), machine=machine).failed == ()
    assert {(one.rule, one.where) for one in judge(PROJECT.load("m15-r1"), machine=machine).failed} == {
        ("polarity", "FY, E5")
    }


def test_a_legacy_record_of_a_rig_needs_a_reading(tmp_path: Path) -> None:
    (tmp_path / "old.toml").write_text(GOOD)
    registry = Registry(tmp_path / "cal")
    import_legacy(tmp_path / "old.toml", registry)
    decided = {"in_force_from": dt.date(2000, 1, 1), "checked_by": "B", "reason": "legacy"}
    assert failed(approve(registry, "old-r1", **decided)) == {"polarity-reading"}  # type: ignore[arg-type]
    file = tmp_path / "reading.toml"
    # F = 2 S + 1: 10 mV/V are 21 N.
    for sign, done in ((-1, False), (1, True)):
        file.write_text(
            f'[[polarity]]\nload = "F"\nvalue = {{ value = {sign * 21}, unit = "N" }}\n'
            'indications = { S = { value = 10.1, unit = "mV/V" } }\n'
        )
        assert approve(registry, "old-r1", polarity=file, **decided).done is done  # type: ignore[arg-type]
