"""Chosen check loads are what an approval asks for, and a flipped sign shows in them."""

from __future__ import annotations

import dataclasses

import numpy as np

from toolkit.calibration.registry.gates import check_loads, unverifiable
from toolkit.planning.check_loads import choose_check_loads
from toolkit.planning.fixtures import FeasibleLoads
from toolkit.planning.knowledge import Knowledge


def test_the_gate_of_an_approval_verifies_every_term(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    chosen, verified = choose_check_loads(knowledge, feasible.loads, frozenset())
    loads = feasible.loads[chosen]
    table = knowledge.table(loads, np.zeros(len(loads), dtype=np.intp), np.ones(len(loads), dtype=bool))
    assert unverifiable(knowledge.record, table) == ()
    assert all(entry.verified for entry in verified)
    assert len(chosen) == 4  # as many as each equation has terms: none fewer has their rank


def test_every_flipped_sign_fails_a_check_load(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    chosen, _ = choose_check_loads(knowledge, feasible.loads, frozenset())
    loads = feasible.loads[chosen]
    table = knowledge.table(loads, np.zeros(len(loads), dtype=np.intp), np.ones(len(loads), dtype=bool))
    record = knowledge.record
    assert check_loads(record, table) == ()
    for at, fit in enumerate(record.loads):
        for term in range(3):
            flipped = [-c if i == term else c for i, c in enumerate(fit.coefficients)]
            others = list(record.loads)
            others[at] = dataclasses.replace(fit, coefficients=tuple(flipped))
            assert check_loads(dataclasses.replace(record, loads=tuple(others)), table)


def test_loads_of_the_fit_are_avoided(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    first, _ = choose_check_loads(knowledge, feasible.loads, frozenset())
    second, verified = choose_check_loads(knowledge, feasible.loads, frozenset(first.tolist()))
    assert not set(first.tolist()) & set(second.tolist())
    assert all(entry.verified for entry in verified)


def test_what_no_load_moves_stays_unverified(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    small = feasible.loads * 1e-4
    _, verified = choose_check_loads(knowledge, small, frozenset())
    assert not any(entry.verified for entry in verified if entry.term != "intercept")
