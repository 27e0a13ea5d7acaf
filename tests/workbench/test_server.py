"""The command: its address, its end, and what is not opened to other computers."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ConfigError
from toolkit.workbench.server import Listening, check_listening

START = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from toolkit.cli.main import run; run()"
)


def started(*words: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", START, "open", *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip


def test_it_prints_its_address_answers_there_and_ends_with_ctrl_c(lab: Path) -> None:
    process = started(lab, "--no-browser")
    assert process.stdout is not None
    assert process.stdout.readline() == f"workbench of {lab}\n"
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    assert process.stdout.readline() == "end it with Ctrl-C\n"
    with urllib.request.urlopen(address, timeout=20) as answer:  # noqa: S310  our own address
        assert "refresh" in answer.read().decode()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (0, "", "")


def test_the_browser_is_given_a_file_of_this_user_not_the_key(lab: Path, tmp_path: Path) -> None:
    # The command line of a browser is read by every user of the computer.
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\nprintf "%s\\n" "$1" > {tmp_path}/opened.part\n'
                       f'p="${{1#file://}}"; cat "$p" > {tmp_path}/page\n'
                       f'stat -c %a "$(dirname "$p")" >> {tmp_path}/page\n'
                       f"mv {tmp_path}/opened.part {tmp_path}/opened\n")  # fmt: skip
    browser.chmod(0o755)
    os.environ["BROWSER"] = str(browser)
    try:
        process = started(lab, "--json")
    finally:
        del os.environ["BROWSER"]
    end = time.monotonic() + 20
    while not (tmp_path / "opened").exists() and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=20)
    address = json.loads(out)["address"]
    key = address.partition("key=")[2]
    opened = (tmp_path / "opened").read_text().strip()
    assert opened.startswith("file:///")
    assert key not in opened
    assert address in (tmp_path / "page").read_text()
    assert (tmp_path / "page").read_text().endswith("700\n")
    assert not Path(opened.removeprefix("file://")).exists()


def test_a_port_that_is_taken_is_exit_2(lab: Path) -> None:
    first = started(lab, "--no-browser", "--quiet", "--json")
    assert first.stdout is not None
    text = "".join(first.stdout.readline() for _ in range(5))
    port = json.loads(text)["address"].split(":")[2].partition("/")[0]
    second = started(lab, "--no-browser", "--json", "--port", port)
    out, _ = second.communicate(timeout=20)
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=20)
    assert (second.returncode, json.loads(out)["error"]["rule"]) == (2, "workbench-port")


@pytest.mark.parametrize("listening", [
    Listening(host="0.0.0.0"),  # noqa: S104  that it is refused is what is tested
    Listening(host="10.0.0.1", certificate=Path("c.pem"), key=Path("k.pem")),
    Listening(certificate=Path("c.pem")),
    Listening(key=Path("k.pem")),
])  # fmt: skip
def test_other_computers_need_a_certificate_and_people(lab: Path, listening: Listening) -> None:
    with pytest.raises(ConfigError) as caught:
        check_listening(listening, Registry(lab / "calibrations"))
    assert caught.value.rule == "workbench-host"


def test_a_home_that_is_none_is_exit_2(tmp_path: Path) -> None:
    process = started(tmp_path, "--no-browser", "--json")
    out, _ = process.communicate(timeout=20)
    assert (process.returncode, json.loads(out)["error"]["rule"]) == (2, "no-home")
