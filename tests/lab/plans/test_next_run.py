"""Files of a run have names that every disk and address takes, whatever its outputs are called."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np

from toolkit.lab.desk import kept_plans
from toolkit.lab.plans.next_run import plots

NAMES = ("F", "F_apart", "Δ", "a b#c?", "../x", "F" * 99)


def test_every_picture_has_a_name_of_its_own_which_the_workbench_shows() -> None:
    noise = SimpleNamespace(marginal_sd=1.0)
    member: Any = SimpleNamespace(label="delay", fit=SimpleNamespace(noise=dict.fromkeys(NAMES, noise)))
    outputs = tuple(SimpleNamespace(name=name, unit="N") for name in NAMES)
    problem: Any = SimpleNamespace(
        model=SimpleNamespace(outputs=outputs), case=SimpleNamespace(has_time=True)
    )
    predicted = SimpleNamespace(outputs=dict.fromkeys(NAMES, np.zeros(3)))
    chosen: Any = SimpleNamespace(run=SimpleNamespace(t=np.arange(3.0)), predicted=(predicted,))
    figures = plots(problem, (member,), chosen)
    names = [f"{figure.name}.png" for figure in figures]
    assert len({*names}) == 2 * len(NAMES)
    assert names[:2] == ["next_F.png", "next_F_apart.png"]
    assert all(kept_plans._PICTURE.fullmatch(name) for name in names)
    assert not any(re.search(r"[^!-~]|[#?/%&]", name) for name in names)
    # People read the output's own name.
    assert [figure.y_label for figure in figures[4:6]] == ["Δ / N", "Δ less that of delay / N"]
