"""What of a tire file is no tire's is told, by the factors that its numbers make."""

from __future__ import annotations

import pytest

from toolkit.errors import ConfigError
from toolkit.tires.tir import parse_tir
from toolkit.tires.tir_checks import file_findings
from toolkit.tires.tir_evaluate import evaluate_tir
from toolkit.tires.tir_write import in_si

# Of the size of published sets (Pacejka 2012, appendix 3).
ENTRIES = {
    "PCX1": 1.6, "PDX1": 1.1, "PKX1": 22.0, "PCY1": 1.3, "PDY1": 1.0, "PKY1": -18.0, "PKY2": 1.7, "QBZ1": 9.0,
    "QCZ1": 1.15, "QDZ1": 0.11,
}  # fmt: skip


def tire(*, radius: object = 0.31, more: str = "", **changes: float | None):
    numbers = {name: value for name, value in {**ENTRIES, **changes}.items() if value is not None}
    return parse_tir(
        "[UNITS]\nLENGTH = 'meter'\n[MODEL]\nFITTYP = 61\n[VERTICAL]\nFNOMIN = 4000\n"
        f"UNLOADED_RADIUS = {radius}\n{more}\n[COEFFICIENTS]\n"
        + "\n".join(f"{name} = {value}" for name, value in numbers.items())
    )


def told(tir) -> list[str]:
    return [finding.rule for finding in file_findings(tir) if finding.level == "warning"]


def test_a_tire_of_usual_size_is_told_of_nothing():
    assert told(tire()) == []


@pytest.mark.parametrize("radius", [0.1, 0.31, 2.0])
def test_radii_of_karts_cars_and_dumpers_are_tires(radius):
    assert told(tire(radius=radius)) == []


@pytest.mark.parametrize("radius", [310, 12.2, 0.00031])
def test_a_radius_in_another_unit_is_told(radius):
    assert told(tire(radius=radius)) == ["tir-free-radius"]


@pytest.mark.parametrize("name", ENTRIES)
def test_zero_gives_what_absence_gives_and_is_told_by_the_same_rule(name):
    zero, absent = tire(**{name: 0.0}), tire(**{name: None})
    forces = [evaluate_tir(tir, SA=0.05, FZ=4000.0, KAPPA=0.02)[0] for tir in (zero, absent)]
    for channel in ("FX", "FY", "MZ"):
        first, second = (getattr(one, channel) for one in forces)
        assert first == pytest.approx(second, nan_ok=True)
    assert told(zero) == told(absent) == ["tir-no-coefficients"]
    assert name in next(f.message for f in file_findings(zero) if f.rule == "tir-no-coefficients")


@pytest.mark.parametrize(
    ("changes", "factor"),
    [
        ({"PDY1": -1.01, "PDY2": -0.1}, "mu_y = -1.01"),
        ({"PDY1": 10.1}, "mu_y = 10.1"),
        ({"LMUY": -1.0}, "mu_y = -1"),
        ({"LMUY": 0.0}, "mu_y = 0"),
        ({"PDX1": 11.0}, "mu_x = 11"),
        ({"LMUX": 0.0}, "mu_x = 0"),
        ({"PCY1": -1.3}, "C_y = -1.3"),
        ({"PCX1": 16.0}, "C_x = 16"),
        ({"PKY1": 18.0}, "-K_y = -"),
        ({"PKY1": -1031.0}, "-K_y = "),  # per degree
        ({"PKY1": -0.314}, "-K_y = "),
        ({"PKX1": -22.0}, "K_x = -22"),
        ({"LKY": -1.0}, "-K_y = -"),
        ({"QDZ1": -0.11}, "D_t = -0.11"),
        ({"QDZ1": 11.0}, "D_t = 11"),
        ({"QCZ1": -1.0}, "C_t = -1"),
    ],
)
def test_a_factor_that_no_tire_has_is_told_with_its_size(changes, factor):
    messages = [f.message for f in file_findings(tire(**changes)) if f.rule == "tir-factors"]
    assert any(factor in message for message in messages)


@pytest.mark.parametrize("turned", [("PDY1", "PDY2"), ("PDX1", "PDX2")])
def test_a_friction_that_is_written_negative_with_its_change_is_the_same_tire(turned):
    """As the PAC2002 file of a truck tire 315/80 R22.5: PDY1 = -0.9, PDY2 = 0.18, PKY1 = -12.95."""
    numbers = ENTRIES | dict(zip(turned, (0.9, -0.18), strict=True))
    written, negative = tire(**numbers), tire(**numbers | {name: -numbers[name] for name in turned})
    assert told(negative) == told(written) == []
    slips = {"SA": [-0.1, 0.02, 0.07], "KAPPA": [0.0, 0.02, -0.05]}
    first, second = (
        evaluate_tir(file, FZ=[2000.0, 4000.0, 6000.0], **slips)[0] for file in (written, negative)
    )
    for channel in ("FX", "FY", "MZ"):
        assert getattr(second, channel) == pytest.approx(getattr(first, channel), rel=1e-12)


def test_a_negative_nominal_pressure_is_refused():
    with pytest.raises(ConfigError, match="NOMPRES is not positive"):
        evaluate_tir(tire(more="NOMPRES = -220000"), SA=0.05, FZ=4000.0)


def test_a_trail_that_leaves_the_contact_patch_is_told():
    _, findings = evaluate_tir(tire(QDZ1=3.0), SA=0.02, FZ=4000.0)
    assert "tir-trail" in [finding.rule for finding in findings]
    _, findings = evaluate_tir(tire(), SA=[-0.2, -0.01, 0.0, 0.01, 0.2], FZ=4000.0)
    assert [finding.rule for finding in findings] == []


def test_a_file_of_uncombined_forces_is_told_where_both_slips_are_asked_for():
    def rules(SA: float, KAPPA: float, mode: int) -> list[str]:
        text = f"[MODEL]\nUSE_MODE = {mode}\n"
        _, findings = evaluate_tir(tire(more=text), SA=SA, FZ=4000.0, KAPPA=KAPPA)
        return [finding.rule for finding in findings]

    assert rules(0.05, 0.02, 3) == rules(0.05, 0.02, 13) == ["tir-use-mode"]
    assert rules(0.05, 0.0, 3) == rules(0.0, 0.02, 3) == rules(0.05, 0.02, 4) == rules(0.05, 0.02, 14) == []


def test_coefficients_have_no_unit_in_a_section_of_any_name():
    text = (
        "[UNITS]\nLENGTH = 'mm'\nFORCE = 'kN'\n[MODEL]\nFITTYP = 61\n[VERTICAL]\nFNOMIN = 4\n"
        "UNLOADED_RADIUS = 310\nQ_OWN = 3\n[COEFFS]\nPCY1 = 1.3\nPKY1 = -18\nLMUY = 0.9\n"
    )
    file, (finding,) = in_si(parse_tir(text))
    assert "Q_OWN" in finding.message
    assert not any(name in finding.message for name in ("PCY1", "PKY1", "LMUY"))
    assert (file.number("FNOMIN"), file.number("PKY1")) == (4000.0, -18.0)
