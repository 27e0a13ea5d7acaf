"""The fast reader of plain TOML answers as `tomllib` does, or not at all."""

from __future__ import annotations

import random
import tomllib
from pathlib import Path

import pytest

from tests.benchmarks.verify_records import SESSION
from toolkit.calibration.session.plain_toml import plain_toml

PLAIN = (
    SESSION.format(number=3)
    + """\

# readings
[[zero]]
when = "before"
values = [1.5e-5, -2, 0.0]

[[zero]]
when = "after"
values = { D51 = 1e-5, D52 = -3.25, E5 = 0 }

[certificate]
interval_agreed = true
note = "gr\u00fc\u00dfe # kein Kommentar"
empty = []
nested = { a = { b = [1, 2], c = "x = {" }, d = false }
"""
)

# Each is wrong TOML, or TOML that the plain reader leaves to tomllib; none may be read differently.
ODD = (
    "a = 1\na = 2",
    "[a]\n[a]",
    "[a.b]\n[a]\nc = 1",
    "a = { b = 1 }\n[a.c]\n",
    "a = { b = 1 }\n[a]\n",
    "a = [1]\n[[a]]\n",
    "[a]\n[[a]]\n",
    "[[a]]\n[a]\n",
    "[[a]]\n[a.b]\n",
    "a = { b = 1, b = 2 }",
    "a = { b = 1, }",
    'a = { "b": 1 }',
    "a = { b = null }",
    "a = [NaN]",
    "a = [Infinity, -Infinity]",
    "a = nan",
    "a = +1",
    "a = 01",
    "a = 1_000",
    "a = [1_000]",
    "a = 1.",
    "a = .5",
    "a = 0x1F",
    "a = [0x1F]",
    "a = 1e400",
    "a = 2026-02-30",
    "a = 2026-01-05T10:00:00",
    "a = [2026-01-05]",
    'a = "x\\n"',
    'a = "x" # comment',
    "a = 1 # comment",
    "a = 'x'",
    'a = """x"""',
    "a.b = 1",
    '"a" = 1',
    "a = { b.c = 1 }",
    'a = { "b" = 1 }',
    "a = [\n1,\n2]",
    "a =",
    "= 1",
    "a",
    "[a",
    "[a] # comment",
    "[ a ]",
    "[]",
    "a = [1,]",
    "a = [1 2]",
    "a = [truefalse]",
    "a = { b = 1 c = 2 }",
    "a = {{}}",
    "a = [[1], [2]]",
    "a = tr\u0443e",
    "a = \u0661",
    "\ufeffa = 1",
    "a = \"\u2028\"",
    "a = 1\r\nb = 2\r\n",
    "a = \t1",
    "a = \"x\ty\"",
    "-1 = 2",
    "a = -0",
    "a = -0.0",
    "a = [1.0, \"x, y\", {}]",
    "a = {}\nb = []",
    "a = [ [ [",
)  # fmt: skip


def expected(data: bytes) -> object:
    try:
        return tomllib.loads(data.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return None


def test_sessions_are_plain() -> None:
    assert plain_toml(PLAIN.encode()) == tomllib.loads(PLAIN)


def test_types_are_those_of_toml() -> None:
    found = plain_toml(b"a = 1\nb = 1.0\nc = true\nd = 2026-01-05\ne = [1, 1.0]\nf = { g = 1, h = 1e0 }\n")
    assert repr(found) == repr(tomllib.loads(
        "a = 1\nb = 1.0\nc = true\nd = 2026-01-05\ne = [1, 1.0]\nf = { g = 1, h = 1e0 }\n"
    ))  # fmt: skip


@pytest.mark.parametrize("text", ODD)
def test_an_odd_text_is_never_read_in_another_way(text: str) -> None:
    data = text.encode()
    found = plain_toml(data)
    assert found is None or repr(found) == repr(expected(data))


def test_changed_texts_are_never_read_in_another_way() -> None:
    rng = random.Random(7)
    alphabet = "ab1.-_=[]{}\",# \n\t:eE+\\'0é"
    read = 0
    for _ in range(4000):
        text = list(PLAIN)
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(len(text))
            text[at] = rng.choice(alphabet) if rng.random() < 0.7 else ""
        data = "".join(text).encode()
        found = plain_toml(data)
        if found is not None:
            read += 1
            assert repr(found) == repr(expected(data)), "".join(text)
    assert read > 500


def test_bytes_that_are_no_text_are_left() -> None:
    assert plain_toml(b"a = \xff") is None


def test_the_project_s_own_sessions(pytestconfig: pytest.Config) -> None:
    files = [*Path(pytestconfig.rootpath, "calibrations").rglob("*.toml")]
    assert files
    for path in files:
        found = plain_toml(path.read_bytes())
        assert found is None or found == tomllib.loads(path.read_text(encoding="utf-8"))
