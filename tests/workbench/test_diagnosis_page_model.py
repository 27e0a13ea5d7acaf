"""The model of an answer by its page: what is set is simulated, isolated, and kept as a model file."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.workbench.conftest import serving
from tests.workbench.test_diagnosis_page import ANSWER, answered, home
from toolkit.lab.desk.holdings import holding_id
from toolkit.simulation.model_file import read_model

__all__ = ["answered", "home"]
PAGE = f"/diagnosis/{ANSWER}/model"


def fields(body: str) -> dict[str, str]:
    """Return what the form of a page sends when nobody touches it."""
    stated = re.findall(r'<input type="number"[^>]* name="([^"]+)" value="([^"]+)"', body)
    switches = re.findall(r'name="(on-\d+)" value="yes" checked', body)
    return dict(stated) | dict.fromkeys(switches, "yes")


def test_the_page_has_the_effects_of_the_answer_and_the_simulation_answers(answered: Path) -> None:
    folder = answered / "diagnoses" / "cases" / "cell"
    answer = json.loads((folder / "diagnosis.json").read_text())
    with serving(answered) as bench:
        assert PAGE in bench.page(f"/diagnosis/{ANSWER}").body
        body = bench.page(PAGE).body
        form = fields(body)
        values = {row["name"]: row["value"] for row in answer["effects"][0]["parameters"]}
        # Each field shows what the interval supports; the value itself stays, to its last digit.
        assert {float(text) for text in re.findall(r'data-fitted="([^"]+)"', body)} == set(values.values())
        assert all(len(text) <= 9 for name, text in form.items() if name.startswith("size"))
        for text in answer["next_measurements"]:
            assert text.partition("'")[0] in body
        whole = bench.send(f"{PAGE}/try", form)
        assert (whole.status, whole.body.count("data-curves=")) == (200, 4)
        off = bench.send(f"{PAGE}/try", {k: v for k, v in form.items() if not k.startswith("on")})
        fitted, without = (float(part.data(rmse="F")[0]) for part in (whole, off))
        # Without the effect it is F = gain L, with the gain that the model has.
        gain = read_model(folder / "model.toml").parameters[0].value
        rows = [
            np.loadtxt(answered / "cases" / "cell" / f"r{i}.csv", delimiter=",", skiprows=1) for i in (0, 1)
        ]
        left = np.concatenate([gain * row[:, 0] - row[:, 1] for row in rows])
        assert without == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-12)
        assert fitted < without / 4
        told = bench.send(
            f"{PAGE}/try", form | {next(n for n in form if n.startswith("size")): "1,x"}, HX_Request="true"
        )
        assert (told.status, "a size is no number" in told.body) == (400, True)


def test_what_is_kept_can_be_simulated_and_sized_again(answered: Path) -> None:
    with serving(answered) as bench:
        form = fields(bench.page(PAGE).body)
        size = next(name for name in form if name.startswith("size"))
        kept = bench.send(f"{PAGE}/keep", form | {size: "1e-6"})
        assert (kept.status, kept.headers["location"]) == (
            303,
            f"{bench.place}{PAGE}?kept=model-1/model.toml",
        )
        assert 'data-kept="models/model-1/model.toml"' in bench.page(f"{PAGE}?kept=model-1/model.toml").body
        for hostile in ("model-2/model.toml", "../calibrations", "model-1/model.toml%0A<b>"):
            assert "data-kept" not in bench.page(f"{PAGE}?kept={hostile}").body
        untouched = bench.send(f"{PAGE}/keep", form).headers["location"].rpartition("kept=")[2]
    fitted = read_model(answered / "diagnoses" / "cases" / "cell" / "model.toml")
    whole = read_model(answered / "models" / untouched)
    assert (whole.verdict, whole.effects[0].applied.values) == ("named", fitted.effects[0].applied.values)
    shutil.rmtree((answered / "models" / untouched).parent)
    model = read_model(answered / "models" / "model-1" / "model.toml")
    assert (model.verdict, model.effects[0].applied.values[size.split("-")[2]]) == ("by hand", 1e-6)


def test_an_answer_whose_case_is_elsewhere_says_so_and_one_without_model_has_no_page(
    answered: Path, tmp_path: Path
) -> None:
    lab = tmp_path / "lab"
    shutil.copytree(answered, lab)
    (lab / "cases" / "cell").rename(tmp_path / "away")
    text = (lab / "diagnoses" / "cases" / "cell" / "model.toml").read_text()
    text = text.replace("../../../cases/cell/", f"{tmp_path}/away/")
    (lab / "diagnoses" / "cases" / "cell" / "model.toml").write_text(text)
    (lab / "diagnoses" / "none").mkdir()
    shutil.copy(lab / "diagnoses" / "cases" / "cell" / "diagnosis.json", lab / "diagnoses" / "none")
    with serving(lab) as bench:
        refused = bench.page(PAGE)
        assert (refused.status, "is not in the home" in refused.body) == (400, True)
        assert bench.page(f"/diagnosis/{holding_id('diagnoses/none')}/model").status == 404
        assert bench.send(f"/diagnosis/{holding_id('cases')}/model/keep", {}).status == 404
    assert not (lab / "models").exists() or len([*(lab / "models").iterdir()]) == 1
