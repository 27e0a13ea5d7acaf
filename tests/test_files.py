"""Files: whole or not at all."""

import contextlib
import errno
import math
import os
import stat
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit import files
from toolkit.calibration.session.session_file import SessionFile
from toolkit.declared.text import read_text
from toolkit.errors import ConfigError, OutputError
from toolkit.files import (
    DEEPEST,
    atomic_path,
    check_keys,
    is_number,
    number_expected,
    parse_json,
    parse_toml,
    read_toml,
    real_path,
    same_file,
    sha256_bytes,
    sha256_file,
    write_atomic,
)
from toolkit.spelling import nearest


def test_write_and_hash(tmp_path: Path) -> None:
    target = tmp_path / "new" / "a.txt"
    write_atomic(target, "text")
    assert target.read_text() == "text"
    assert sha256_file(target) == sha256_bytes(b"text")
    assert [p.name for p in target.parent.iterdir()] == ["a.txt"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    write_atomic(target, "old")

    def fail() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full to stand for a full disk")
def test_a_full_disk_is_an_error_with_a_next_step(tmp_path: Path) -> None:
    def fill() -> None:
        with atomic_path(tmp_path / "a.txt"), Path("/dev/full").open("wb", buffering=0) as stream:
            stream.write(b"x")

    with pytest.raises(OutputError) as caught:
        fill()
    assert "No space left" in str(caught.value.got)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        write_atomic(tmp_path / "file" / "a.txt", "x")


def test_unknown_key_names_the_nearest() -> None:
    with pytest.raises(ConfigError) as caught:
        check_keys({"operater": "x"}, ["operator", "requestor"], where="test.toml")
    assert caught.value.next_step == "did you mean 'operator'?"


@pytest.mark.parametrize("content", [b"a = ", b"\xff\xfe", b"a = 1\na = 2"])
def test_broken_toml(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(ConfigError, match="not TOML"):
        read_toml(tmp_path / "x.toml")


def test_missing_toml(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_toml(tmp_path / "x.toml")


def test_a_mark_of_byte_order_before_toml_changes_nothing() -> None:
    assert parse_toml(b"\xef\xbb\xbfa = 1\n", where="x.toml") == {"a": 1}


@pytest.mark.parametrize("text", ["a = 1" + "0" * 5000, "a = " + "[" * 5000 + "]" * 5000])
def test_toml_that_no_parser_can_hold_is_an_error_with_a_next_step(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_toml(text.encode(), where="session.toml")
    assert (caught.value.rule, caught.value.where) == ("not-toml", "session.toml")


def test_a_number_whose_products_are_no_floats_is_no_number() -> None:
    # The largest double is 1.797...e308 (IEEE 754 binary64): a product of three is still one.
    whole = parse_toml(f"a = 1{'0' * 100}\nb = {'9' * 309}\nc = -1.1e100".encode(), where="")
    assert [is_number(whole[key]) for key in "abc"] == [True, False, False]
    assert math.isfinite(1e100 * 1e100 * 1e100)


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600), (0o002, 0o664)])
def test_a_new_file_has_what_the_umask_leaves(tmp_path: Path, umask: int, mode: int) -> None:
    before = os.umask(umask)
    try:
        write_atomic(tmp_path / "new.toml", "text")
        (tmp_path / "plain").write_text("text")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new.toml").stat().st_mode) == mode
    assert (tmp_path / "plain").stat().st_mode == (tmp_path / "new.toml").stat().st_mode


@pytest.mark.parametrize("mode", [0o600, 0o644, 0o664, 0o444])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "old.toml"
    path.write_text("old")
    path.chmod(mode)
    write_atomic(path, "new")
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("new", mode)


def test_a_part_is_readable_by_nobody_whom_the_file_keeps_out(tmp_path: Path) -> None:
    path = tmp_path / "secret.toml"
    path.write_text("old")
    path.chmod(0o600)
    with atomic_path(path) as part:
        assert stat.S_IMODE(part.stat().st_mode) == 0o600
        part.write_text("new")


def test_what_a_flush_does_not_confirm_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_folder: Path) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(files, "sync_folder", broken)
    with pytest.raises(OutputError) as caught:
        write_atomic(tmp_path / "new.toml", "text")
    assert (tmp_path / "new.toml").read_text() == "text"
    assert "in its place" in (caught.value.next_step or "")


def test_links_are_followed_as_far_as_they_lead(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("other")
    (tmp_path / "other").symlink_to("loop")
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("file")
    assert real_path(tmp_path / "link") == real_path(tmp_path) / "file"
    assert real_path(tmp_path / "loop").parent == real_path(tmp_path)
    assert real_path(Path("a\0b")).name == "a\0b"
    assert same_file(tmp_path / "link", tmp_path / "file")
    assert same_file(tmp_path / "none", tmp_path / "x" / ".." / "none")
    assert not same_file(tmp_path / "loop", tmp_path / "file")


def test_a_number_out_of_reach_is_told_its_reach() -> None:
    told = number_expected(-1e101, "a finite number")
    assert told == number_expected(10**400, "a finite number") == "a number of at most 1e+100 in size"
    for value in (1e100, math.inf, math.nan, "1e101", None, True):
        assert number_expected(value, "a finite number") == "a finite number"


def seconds(text: str) -> float:
    started = time.perf_counter()
    with contextlib.suppress(ConfigError):
        parse_toml(text.encode(), where="x.toml")
    return time.perf_counter() - started


@pytest.mark.parametrize(
    "key",
    [
        "a." * 50_000 + "a = 1\n",
        "[" + "a." * 50_000 + "a]\nb = 1\n",
        "[[" + "a." * 50_000 + "a]]\n",
        "x = {" + "a." * 50_000 + "a = 1}\n",
        '"\\"". ' * 30_000 + "a = 1\n",
        "'.' . " * 30_000 + "a = 1\n",
        'x = """\n"""\n' + "a." * 50_000 + "a = 1\n",
    ],
)
def test_a_key_of_countless_parts_is_refused_at_once(key: str) -> None:
    """Its length is that of a page of text; the library's reader takes the square of its parts."""
    started = time.perf_counter()
    with pytest.raises(ConfigError, match="not TOML") as caught:
        parse_toml(key.encode(), where="x.toml")
    assert time.perf_counter() - started < 5
    assert caught.value.rule == "not-toml"
    assert "parts (at line" in str(caught.value.got)


@pytest.mark.parametrize(
    "text",
    [
        'x = "' + "a." * 500 + 'a"\n',
        "x = '''\n" + "a." * 500 + "a\n'''\n",
        "# " + "a." * 500 + "a\n",
        "x = [" + "1.5, " * 500 + "2.5]\n",
        'x = 1 # """ \'\n' + 'y = "' + "a." * 200 + '"\n',
        ".".join(f"k{i}" for i in range(DEEPEST)) + " = 1\n",
    ],
)
def test_dots_that_part_no_key_are_read(text: str) -> None:
    assert parse_toml(text.encode(), where="x.toml") == tomllib.loads(text)


@pytest.mark.parametrize(
    "page",
    [
        lambda n: '"""\\' * n,
        lambda n: '"\\' * n,
        lambda n: "'''x" * n,
        lambda n: "a.a." * 24 + "a = 1\n" + "".join(f"k{i} = 1\n" for i in range(n // 4)),
        lambda n: "x = [" + "[" * 80 + "]" * 80 + ", 1" * n + "]\n",
        lambda n: "k" * 4 * n + " = 1\n",
        lambda n: 'x = "' + "y" * 4 * n + '"\n',
    ],
)
def test_a_text_twice_as_long_takes_about_twice_as_long(page: Callable[[int], str]) -> None:
    """Linear: four times the text in at most eight times the time, where the square would take sixteen."""
    short = min(seconds(page(20_000)) for _ in range(3))
    assert min(seconds(page(80_000)) for _ in range(3)) < 8 * max(short, 0.02)


def test_a_name_that_stands_twice_is_found_without_counting_all() -> None:
    names = [f'"n{i}": 1' for i in range(60_000)]
    started = time.perf_counter()
    with pytest.raises(ValueError, match="twice"):
        parse_json("{" + ", ".join([*names, names[-1]]) + "}")
    assert time.perf_counter() - started < 5


@pytest.mark.parametrize("line", ["k{} = 1\n", "[k{}]\na = 1\n", "[[data]]\nk{} = 1\n", "cells.k{}.a = 1\n"])
def test_a_file_of_faults_alone_takes_a_time_of_its_length(line: str) -> None:
    """Each fault asks for its line and for what was meant; five thousand took seven minutes."""
    text = "".join(line.format(number) for number in range(5000))
    started = time.perf_counter()
    with pytest.raises(ConfigError) as caught:
        read_text(SessionFile, text.encode(), where="SESSION.toml")
    assert time.perf_counter() - started < 10
    assert "more" in str(caught.value.got) or "[[data]]" in line


def test_a_key_of_a_page_is_no_misspelt_one() -> None:
    started = time.perf_counter()
    assert nearest("instrument" * 50_000, ["instrument"]) is None
    assert time.perf_counter() - started < 1
