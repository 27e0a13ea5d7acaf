"""A law beside an effect: what has a name keeps it where the law only mends its form."""

from __future__ import annotations

from pathlib import Path

from tests.golden.cases import columns_tire
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose


def test_a_leak_of_the_load_keeps_its_name_where_the_law_acts_behind_the_filter(tmp_path: Path) -> None:
    """A pull in proportion to the load stands beside a late force: crosstalk is thought of before the lag.

    The law a*FZ behind it fits better; it is the same leak, and the answer is no worse for its name.
    """
    files = columns_tire(pull=120.0, lag=0.2)
    # The moment has no part in it.
    for moment in (', MZ = "MZ_sim"', 'MZ = { unit = "N*m", role = "output" }\n'):
        assert moment in files["CASE.toml"]
        files["CASE.toml"] = files["CASE.toml"].replace(moment, "")
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    answer = diagnose(read_case(tmp_path / "CASE.toml"), None).diagnosis
    classes = [{effect.name, *effect.equivalent_to} for effect in answer.effects]
    assert {"channel_delay"} in classes
    assert any({"crosstalk", "conicity"} <= each for each in classes)
    force = answer.fit.held_out[0]
    assert force.augmented_rmse < 0.05 * force.refitted_rmse
