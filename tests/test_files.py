"""Files: whole or not at all."""

import os
from pathlib import Path

import pytest

from toolkit.errors import ConfigError, OutputError
from toolkit.files import (
    atomic_path,
    check_keys,
    is_number,
    parse_toml,
    read_regular,
    read_toml,
    sha256_bytes,
    sha256_file,
    write_atomic,
)


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


def test_mode_is_readable_by_others(tmp_path: Path) -> None:
    write_atomic(tmp_path / "a", b"x")
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o644


def test_only_a_regular_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"whole")
    (tmp_path / "link").symlink_to("file")
    (tmp_path / "endless").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe")
    assert read_regular(tmp_path / "file") == read_regular(tmp_path / "link") == b"whole"
    for name in ("pipe", "endless", "."):
        with pytest.raises(OSError, match="not a regular file"):
            read_regular(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        read_regular(tmp_path / "none")
    with pytest.raises(ConfigError) as caught:
        read_toml(tmp_path / "pipe")
    assert (caught.value.rule, str(caught.value.got)) == ("no-file", "not a regular file")


def test_a_mark_of_byte_order_before_toml_changes_nothing() -> None:
    assert parse_toml(b"\xef\xbb\xbfa = 1\n", where="x.toml") == {"a": 1}


@pytest.mark.parametrize("text", ["a = 1" + "0" * 5000, "a = " + "[" * 5000 + "]" * 5000])
def test_toml_that_no_parser_can_hold_is_an_error_with_a_next_step(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_toml(text.encode(), where="session.toml")
    assert (caught.value.rule, caught.value.where) == ("not-toml", "session.toml")


def test_a_whole_number_beyond_every_float_is_no_number() -> None:
    largest = parse_toml(f"a = {'9' * 308}\nb = {'9' * 309}".encode(), where="")
    # The largest double is 1.797...e308 (IEEE 754 binary64).
    assert (is_number(largest["a"]), is_number(largest["b"])) == (True, False)
