"""A peer simulates freely, chooses on the training part, and says where it diverged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.peers import PEERS, Fitted, Peer, _freely, _lagged, evaluate, simulate
from benchmarks.records import Array, Record


def plant(rows: int, *, seed: int, warm_up: int = 0, lead_in: int = 0) -> Record:
    """Return y[k] = 0.9 y[k-1] + 0.5 u[k], from rest."""
    u = np.random.default_rng(seed).normal(size=rows)
    y = np.zeros(rows)
    for k in range(1, rows):
        y[k] = 0.9 * y[k - 1] + 0.5 * u[k]
    return Record(name=f"plant{seed}", t=np.arange(float(rows)), u=u, y=y, warm_up=warm_up, lead_in=lead_in)


def arx(pole: float, *, lags: int = 1) -> Fitted:
    def step(row: Array) -> float:
        return float(pole * row[0] + 0.5 * row[lags])

    return _freely(step, lags, 1e6)


def test_the_true_model_simulates_a_record_exactly_from_its_first_rows_alone() -> None:
    record = plant(200, seed=1, warm_up=1)
    # Spoiled outputs after the warm-up must not be looked at.
    spoiled = replace(record, y=np.concatenate([record.y[:1], np.full(199, 1e3)]))
    assert simulate(arx(0.9), spoiled, 1) == pytest.approx(record.y)


def test_a_record_with_a_lead_in_is_simulated_from_its_inputs_and_first_output() -> None:
    record = plant(200, seed=2, warm_up=2, lead_in=100)
    assert record.error_of(simulate(arx(0.9, lags=3), record, 3)) < 1e-4


def test_a_model_that_runs_away_is_not_a_number_from_there_on_and_its_error_infinite() -> None:
    record = plant(400, seed=3, warm_up=1)
    simulated = simulate(arx(1.2), record, 1)
    assert np.isnan(simulated[-1])
    assert record.error_of(simulated) == np.inf


def test_lags_do_not_span_two_records() -> None:
    first, second = plant(10, seed=4), plant(10, seed=5)
    x, y = _lagged([first, second], 2)
    assert x.shape == (16, 5)
    assert y[8] == second.y[2]
    # two outputs of the past, then the input of this row and of two rows before it
    assert x[8] == pytest.approx([second.y[1], second.y[0], second.u[2], second.u[1], second.u[0]])


def test_the_choice_is_made_on_the_training_part_and_the_test_is_scored_once_with_it() -> None:
    seen: list[int] = []

    def fit(records: list[Record], *, lags: int, pole: float) -> Fitted:
        seen.append(sum(len(r.t) for r in records))
        return arx(pole, lags=lags)

    choices: tuple[dict[str, Any], ...] = tuple({"lags": 1, "pole": pole} for pole in (0.5, 0.9, 0.99))
    peer = Peer(name="poles", package="none", choices=choices, fit=fit)
    train, test = [plant(200, seed=6), plant(80, seed=7)], [plant(50, seed=8, warm_up=1)]
    errors, chosen = evaluate(peer, train, test)
    assert chosen["pole"] == 0.9
    assert errors == pytest.approx([0.0], abs=1e-12)
    # three fits on three quarters of the training rows, one on all of them, none with a row of the test
    assert seen == [210, 210, 210, 280]


def test_a_peer_that_cannot_be_fitted_has_an_infinite_error() -> None:
    def fit(records: list[Record], *, lags: int) -> Fitted:
        raise ValueError("more terms than rows can tell apart")

    peer = Peer(name="none", package="none", choices=({"lags": 1},), fit=fit)
    assert evaluate(peer, [plant(40, seed=9)], [plant(20, seed=10)])[0] == [np.inf]


def test_every_peer_names_its_package_and_has_choices() -> None:
    assert {peer.package for peer in PEERS} == {"sysidentpy", "pysindy", "sklearn"}
    assert all("lags" in choice for peer in PEERS for choice in peer.choices)
