"""A session whose cells carried a load that it does not name: no plan of the named ones can repeat it."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from toolkit.errors import ConfigError
from toolkit.planning.fixtures import loads_of_record
from toolkit.planning.knowledge import Knowledge
from toolkit.planning.session_search import Demand, SessionSearch


def without(settings: Any, load: str) -> Any:
    """Return a record's settings without a load."""
    if isinstance(settings, dict):
        return {key: without(value, load) for key, value in settings.items() if key != load}
    if isinstance(settings, list):
        return [without(value, load) for value in settings if value != load]
    return settings


def test_the_cell_that_an_unnamed_load_moves_most_is_named(knowledge: Knowledge) -> None:
    # The drawing of the hub: MX = 0.05 (D51 + D52) - 0.10 E5, so that E5 takes most of an overturning moment.
    fits = tuple(fit for fit in knowledge.record.loads if fit.load != "MX")
    assert len(fits) == 2 < len(knowledge.record.indications)
    record = dataclasses.replace(
        knowledge.record,
        loads=fits,
        settings=json.dumps(without(json.loads(knowledge.record.settings), "MX")),
    )
    own = Knowledge.of(record, knowledge.loads, None)
    with pytest.raises(ConfigError, match="load that the session does not name") as caught:
        SessionSearch(own, loads_of_record(record, [own.loads]), Demand())
    assert caught.value.rule == "plan-record"
    assert "range of E5" in caught.value.got
    assert "FY, MZ" in caught.value.got
    assert "MX" in caught.value.next_step


def test_few_loads_of_a_record_that_names_all_are_no_unnamed_load(knowledge: Knowledge) -> None:
    feasible = loads_of_record(knowledge.record, [knowledge.loads])
    # A diagonal: all three loads together in one combination.
    along = feasible.loads.max(axis=0)
    one_way = dataclasses.replace(feasible, loads=feasible.amount[:, None] * along)
    with pytest.raises(ConfigError, match="cannot tell the coefficients apart"):
        SessionSearch(knowledge, one_way, Demand())
