"""What was computed is kept, the oldest goes first, and no more bytes than there may be."""

import numpy as np

from toolkit.diagnosis.simulators.memory import Memory


def test_the_oldest_goes_where_there_are_too_many():
    memory = Memory(2, 10_000)
    for key in "abc":
        memory[key] = np.zeros(3)
    assert [key in memory for key in "abc"] == [False, True, True]


def test_the_oldest_go_where_there_are_too_many_bytes():
    memory = Memory(10, 1_000)
    memory["table"] = {"x": np.zeros(50), "y": np.zeros(50)}
    memory["error"] = ValueError("none")
    memory["array"] = np.zeros(100)
    assert "table" not in memory
    assert [key in memory for key in ("error", "array")] == [True, True]


def test_what_is_kept_anew_counts_once():
    memory = Memory(10, 1_000)
    memory["a"] = np.zeros(60)
    memory["a"] = np.ones(60)
    memory["b"] = np.zeros(60)
    assert memory["a"][0] == 1.0
    assert "b" in memory
