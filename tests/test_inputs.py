"""Inputs: regular files within the limit of their form, and nothing else is opened, let alone read."""

from __future__ import annotations

import errno
import os
import re
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.test_main_paths import commands
from tests.conftest import EXAMPLES
from toolkit import inputs
from toolkit.cli.main import run
from toolkit.errors import ConfigError, TemplateError, ToolkitError, UnreadableError
from toolkit.files import read_toml, sha256_bytes, sha256_file
from toolkit.inputs import (
    RECORDING_FILE,
    SETTINGS_FILE,
    TIRE_FILE,
    Form,
    TooLargeError,
    limit_of,
    open_regular_to_append,
    raise_limits,
    read_input,
    read_regular,
    size_of,
    size_text,
)

FORMS = [form for form in vars(inputs).values() if isinstance(form, Form)]
SMALL = Form(title="the tire file", limit=100, reason="of this test")
SPECIAL = ("pipe", "socket", "folder", "endless", "terminal", "to-pipe")


@pytest.fixture(autouse=True)
def _limits() -> Iterator[None]:
    yield
    raise_limits(0)


@pytest.fixture
def special(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one of everything that is no regular file, under every ending."""
    monkeypatch.chdir(tmp_path)  # the path of a socket has at most 108 bytes
    os.mkfifo("pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("socket")
    Path("folder").mkdir()
    Path("endless").symlink_to("/dev/zero")
    Path("terminal").symlink_to("/dev/tty")
    Path("to-pipe").symlink_to("pipe")
    return tmp_path


@pytest.mark.parametrize("name", SPECIAL)
def test_nothing_but_a_regular_file_is_opened(special: Path, name: str) -> None:
    with pytest.raises(OSError, match="not a regular file"):
        read_regular(special / name)
    with pytest.raises(OSError, match="not a regular file"):
        sha256_file(special / name)
    for form in FORMS:
        with pytest.raises(ToolkitError) as caught:
            read_input(special / name, form)
        assert type(caught.value) is form.error
        assert None not in (caught.value.got, caught.value.expected, caught.value.next_step)
    with pytest.raises(OSError, match="not a regular file"):
        open_regular_to_append(special / name)


def test_a_regular_file_and_a_link_to_it_are_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"whole")
    (tmp_path / "link").symlink_to("file")
    assert read_regular(tmp_path / "file") == read_regular(tmp_path / "link") == b"whole"
    with pytest.raises(FileNotFoundError):
        read_regular(tmp_path / "none")
    with pytest.raises(ConfigError) as caught:
        read_toml(tmp_path / "none")
    assert (caught.value.rule, caught.value.got) == ("no-file", os.strerror(errno.ENOENT))


def test_a_file_that_tells_no_size_is_read_up_to_its_end() -> None:
    status = Path("/proc/self/status")
    assert status.stat().st_size == 0
    assert read_regular(status).startswith(b"Name:")
    assert sha256_file(Path("/proc/version")) == sha256_bytes(Path("/proc/version").read_bytes())
    tiny = Form(title="the file", limit=4, reason="of this test")
    with pytest.raises(TooLargeError, match="more than 4 bytes, over the limit of 4 bytes"):
        read_regular(status, tiny)


def test_a_file_that_waits_for_what_is_to_come_is_no_input(tmp_path: Path) -> None:
    # An event descriptor reads like a file of the kernel that has nothing yet: EAGAIN, for ever.
    handle = os.eventfd(0, os.EFD_NONBLOCK)
    try:
        with pytest.raises(OSError, match="not a regular file"):
            read_regular(Path(f"/proc/self/fd/{handle}"))
    finally:
        os.close(handle)


def test_the_limit_is_in_the_message_and_the_flag_that_raises_it(tmp_path: Path) -> None:
    path = tmp_path / "a.tir"
    path.write_bytes(bytes(100))
    assert len(read_input(path, SMALL)) == 100
    path.write_bytes(bytes(101))
    with pytest.raises(UnreadableError) as caught:
        read_input(path, SMALL)
    error = caught.value
    assert (error.rule, error.where, error.got) == ("too-large", str(path), "101 bytes")
    assert error.expected == "at most 100 bytes: of this test"
    assert "--max-size" in str(error.next_step)
    raise_limits(101)
    assert len(read_input(path, SMALL)) == 101


def test_a_file_larger_than_memory_is_refused_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "sparse.csv"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(UnreadableError, match="too large"):
        read_input(path, RECORDING_FILE)


def test_limits_are_raised_and_never_lowered() -> None:
    raise_limits(1000)
    assert limit_of(TIRE_FILE) == TIRE_FILE.limit
    raise_limits(2**40)
    assert {limit_of(form) for form in FORMS} == {2**40}


@pytest.mark.parametrize("text", ["", "2 XB", "-1", "1e9", "nan", "2GB2"])
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(ValueError, match="is no size"):
        size_of(text)


def test_sizes_are_read_as_they_are_written() -> None:
    assert [size_of(size_text(size)) for size in (1 << 10, 128 << 20, 1 << 30)] == [
        1 << 10, 128 << 20, 1 << 30,
    ]  # fmt: skip


def _ran(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[object, str]:
    """Run a command in this process, which a signal ends where it waits; return its code and what it said."""
    signal.setitimer(signal.ITIMER_REAL, 60)
    try:
        with pytest.raises(SystemExit) as ended:
            run(words)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    return ended.value.code, capsys.readouterr().err


def test_the_flag_of_every_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.toml"
    path.write_bytes(b"#" * (SETTINGS_FILE.limit + 1))
    command = ["simulate", str(path), "--out", str(tmp_path / "out")]
    code, errors = _ran(command, capsys)
    assert (code, "too large" in errors, "--max-size" in errors) == (2, True, True)
    code, errors = _ran([*command, "--max-size", "20MB"], capsys)
    assert (code, "too large" in errors) == (2, False)
    assert _ran([*command, "--max-size", "much"], capsys)[0] == 2
    assert [name for name, c in commands() if "max_size" not in [option.name for option in c.params]] == []


def test_a_template_beyond_its_limit_is_a_fault_of_the_template(tmp_path: Path) -> None:
    from toolkit.report.word.package import read_template

    path = tmp_path / "x.docx"
    with path.open("wb") as stream:
        stream.truncate(1 << 32)
    with pytest.raises(TemplateError, match="too large"):
        read_template(path)


def test_the_page_of_inputs_has_every_limit() -> None:
    page = (EXAMPLES.parents[1] / "docs" / "inputs.md").read_text(encoding="utf-8").partition("\n## ")[0]
    stated = {size_of(text) for text in re.findall(r"\| (\d+ MB)", page)}
    assert stated == {form.limit for form in FORMS if form.title != "the PDF"}


def test_a_folder_in_a_files_place_is_told_with_what_lies_in_it(tmp_path: Path) -> None:
    for name in ("SESSION.toml", "loads.csv", ".hidden"):
        (tmp_path / name).write_text("x")
    with pytest.raises(ToolkitError) as caught:
        read_input(tmp_path, SETTINGS_FILE)
    assert (caught.value.rule, caught.value.got) == (
        "folder-for-file",
        "a folder with SESSION.toml, loads.csv",
    )
    with pytest.raises(ToolkitError) as caught:
        read_input(tmp_path / "none", SETTINGS_FILE)
    assert caught.value.rule == "no-file"
