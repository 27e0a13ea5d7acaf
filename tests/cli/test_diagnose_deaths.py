"""A case's code that ends its process, from the command line: exit code 2, and one JSON document."""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import SIMULATOR, write_case
from toolkit.cli.main import run

START = "import ctypes, os, signal, sys, threading, time\nimport pandas as pd\ndef simulate(inputs, p):\n    "
GOOD = "return pd.DataFrame({'F': p['mass'] * inputs['a'] + p['c'] * inputs['v']})\n"
ODE = case_text(
    "ode",
    time=None,
    parameters={"k": (1.0, "1/s", 0.1)},
    others={"t": {"unit": "s", "role": "time"}},
    outputs={"F": "N"},
    runs=1,
    states=["x"],
)
EQUATION = "def rhs(t, x, u, p):\n    BODY\n    return [-p['k'] * x[0]]\n"
EQUATION += "def outputs(x, u, p):\n    return {'F': x[0]}\ndef initial(p):\n    return [1.0]\n"


def apart(*words: object, **options: object) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own: the test asks about its end, or its environment."""
    command = [sys.executable, "-c", "from toolkit.cli.main import run; run()", *map(str, words)]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=120, **options)


@pytest.fixture
def answered(capfd):
    """Run the command line here; return its exit code and what reached the descriptors of both streams."""

    def call(*words: object) -> subprocess.CompletedProcess[str]:
        with pytest.raises(SystemExit) as ended:
            run([*map(str, words)])
        return subprocess.CompletedProcess(words, int(ended.value.code or 0), *capfd.readouterr())

    return call


def refused(case: Path, *words: object) -> dict[str, str]:
    """Return the error of a diagnosis that ends with exit code 2, one document, and nothing left behind."""
    out = case.parent / "answer"
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), pytest.raises(SystemExit) as ended:
        run([*map(str, ("diagnose", case, "--out", out, "--json", *words))])
    assert ended.value.code == 2
    assert not out.exists()
    return json.loads(printed.getvalue())["error"]


@pytest.mark.parametrize(
    ("body", "cause"),
    [
        ("os._exit(0)", "exit code 0"),
        ("os._exit(7)", "exit code 7"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "SIGKILL"),
        ("os.abort()", "SIGABRT"),
        ("ctypes.string_at(0)", "SIGSEGV"),
        pytest.param(
            "sys.setrecursionlimit(10**9); a = []\n    for _ in range(10**6): a = [a]\n    repr(a)",
            "SIGSEGV",
            marks=pytest.mark.campaign("a second way to the same signal"),
        ),
        ("os.closerange(0, 4096)", "closed"),
        ("os.execv('/bin/true', ['true'])", "exit code 0"),
    ],
)
def test_the_death_of_a_simulator_is_an_error_with_its_cause(tmp_path, body, cause):
    error = refused(write_case(tmp_path, simulator=START + body + "\n    " + GOOD))
    assert error["rule"] == "simulator-died"
    assert cause in error["got"]
    assert error["where"].endswith("sim.py, r0.csv")


@pytest.mark.parametrize(
    ("body", "cause"),
    [
        ("raise KeyboardInterrupt", "KeyboardInterrupt"),
        ("raise SystemExit(0)", "SystemExit"),
        ("raise BaseException('no end')", "no end"),
        ("b = bytearray(64 << 30)", "MemoryError"),
    ],
)
def test_what_only_would_end_a_process_is_an_error_of_the_simulator(tmp_path, body, cause):
    error = refused(write_case(tmp_path, simulator=START + body + "\n    " + GOOD))
    assert error["rule"] == "simulator"
    assert cause in error["got"]


@pytest.mark.parametrize("place", ["rhs", "load"])
def test_an_equation_that_ends_its_process_is_an_error(tmp_path, place):
    body = "import os; os._exit(0)"
    text = EQUATION.replace("BODY", body if place == "rhs" else "pass")
    error = refused(write_case(tmp_path, ODE, simulator=text if place == "rhs" else f"{body}\n{text}"))
    assert (error["rule"], "exit code 0" in error["got"]) == ("simulator-died", True)


def test_the_last_words_are_in_the_error_without_what_a_terminal_would_obey(tmp_path):
    says = "print('no oil\\x1b[2J left'); sys.stderr.write('at 80 kg'); os._exit(3)"
    error = refused(write_case(tmp_path, simulator=START + says + "\n    " + GOOD))
    assert "no oil" in error["got"]
    assert "at 80 kg" in error["got"]
    assert "\x1b" not in error["got"]


@pytest.mark.campaign(
    "a whole diagnosis: what a simulator prints is kept from the answer in every run (test_user_code)"
)
def test_a_simulator_that_prints_without_end_does_not_end_the_tool(tmp_path, answered):
    says = "os.write(2, b'n' * 300_000)\n    print('n' * 300_000)\n    os.system('echo more')\n    "
    case = write_case(tmp_path, simulator=START + says + GOOD)
    ended = answered("diagnose", case, "--out", tmp_path / "answer", "--json")
    assert ended.returncode == 1, ended.stderr
    assert json.loads(ended.stdout)["verdict"] == "named"
    assert ended.stderr == ""


@pytest.mark.campaign(
    "a whole diagnosis in which most runs die: refused parameters are told in every run (test_user_code)"
)
def test_one_set_of_parameters_that_kills_is_a_failed_run_and_told(tmp_path, answered):
    dies = "if p['mass'] != 94.0: print('only 94', flush=True); os._exit(5)\n    "
    case = write_case(tmp_path, simulator=START + dies + GOOD)
    ended = answered("diagnose", case, "--out", tmp_path / "answer", "--json")
    answer = json.loads(ended.stdout)
    if ended.returncode == 2:  # more deaths than restarts
        assert answer["error"]["rule"] == "simulator-died"
        return
    (found,) = (one for one in answer["findings"] if one["rule"] == "simulator-died")
    assert "exit code 5" in found["message"]
    assert "only 94" in found["message"]
    assert "mass = " in found["message"]


def alive(mark: str) -> list[int]:
    """Return the processes whose command line or environment has a mark."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            texts = (folder / "environ").read_bytes() + (folder / "cmdline").read_bytes()
            state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if mark.encode() in texts and state != "Z" and int(folder.name) != os.getpid():
            found.append(int(folder.name))
    return found


LEAVES = "import subprocess\n    subprocess.Popen(['sleep', '600'], start_new_session=True)\n    "


DIES = pytest.mark.campaign("the simulator dies as well: every cause of its death is told in every run")


@pytest.mark.parametrize("end", ["", pytest.param("os._exit(1)\n    ", marks=DIES)])
def test_no_process_of_a_simulator_outlives_the_tool(tmp_path, end):
    mark = f"MARK_{os.getpid()}_{tmp_path.name}"
    case = write_case(tmp_path, simulator=START + LEAVES + end + GOOD)
    apart("diagnose", case, "--out", tmp_path / "answer", "--budget", 2, env={**os.environ, mark: "1"})
    assert alive(mark) == []


def test_a_fork_bomb_is_ended(tmp_path):
    mark = f"MARK_{os.getpid()}_{tmp_path.name}"
    bomb = "end = time.time() + 9\n    while time.time() < end:\n        os.fork(); time.sleep(0.1)\n    "
    case = write_case(tmp_path, simulator=START + bomb + GOOD)
    ended = apart("diagnose", case, "--out", tmp_path / "out", "--json", env={**os.environ, mark: "1"})
    assert ended.returncode == 2
    assert "processes" in json.loads(ended.stdout)["error"]["got"]
    assert alive(mark) == []


BETWEEN = pytest.mark.campaign("a signal that can be caught: one that cannot ends the worker in every run")


@pytest.mark.parametrize(
    "sent",
    [
        pytest.param(signal.SIGINT, marks=BETWEEN),
        pytest.param(signal.SIGTERM, marks=BETWEEN),
        signal.SIGKILL,
    ],
)
def test_the_worker_ends_with_the_tool(tmp_path, sent):
    mark = f"MARK_{os.getpid()}_{tmp_path.name}"
    waits = f"open({str(tmp_path / 'begun')!r}, 'w').close(); time.sleep(600)\n    "
    case = write_case(tmp_path, simulator=START + waits + GOOD)
    # A shell's background job ignores the interrupt, and so does every process that it starts.
    hears = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    command = [sys.executable, "-c", f"{hears}; from toolkit.cli.main import run; run()", "diagnose", case]
    with subprocess.Popen(
        [*command, "--out", tmp_path / "answer"],
        env={**os.environ, mark: "1"},
        stderr=subprocess.PIPE,
    ) as process:
        while not (tmp_path / "begun").exists() and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(sent)
        process.wait(timeout=30)
    assert process.returncode == (130 if sent == signal.SIGINT else -sent)
    for _ in range(100):
        if not alive(mark):
            break
        time.sleep(0.05)
    assert alive(mark) == []
    assert not (tmp_path / "answer").exists()


def test_a_call_in_compiled_code_ends_with_the_budget(tmp_path, answered):
    hangs = "ctypes.PyDLL(None).sleep(600)\n    "  # holds the interpreter: no signal handler of Python runs
    case = write_case(tmp_path, simulator=START + hangs + GOOD)
    ended = answered("diagnose", case, "--out", tmp_path / "answer", "--budget", 2, "--json")
    assert ended.returncode == 1
    assert json.loads(ended.stdout)["complete"] is False


@pytest.mark.campaign(
    "a whole diagnosis first: the same worker runs a case's code, whose deaths are told in every run"
)
def test_a_model_file_runs_its_code_apart_as_well(tmp_path, answered):
    case = write_case(tmp_path, simulator=SIMULATOR)
    assert answered("diagnose", case, "--out", tmp_path / "answer").returncode == 1
    (tmp_path / "sim.py").write_text(SIMULATOR)
    text = (tmp_path / "answer" / "model.toml").read_text()
    (tmp_path / "sim.py").write_text("import os\nos._exit(0)\n")
    from toolkit.files import sha256_file

    lines = [
        f'path = "{sha256_file(tmp_path / "sim.py")}"'
        if line.startswith("path = ") and len(line) > 60
        else line
        for line in text.splitlines()
    ]
    (tmp_path / "answer" / "model.toml").write_text("\n".join(lines))
    ended = answered(
        "simulate", tmp_path / "answer" / "model.toml", "--inputs", tmp_path / "r0.csv", "--out",
        tmp_path / "more", "--json",
    )  # fmt: skip
    assert ended.returncode == 2
    assert json.loads(ended.stdout)["error"]["rule"] == "simulator-died"
    assert not (tmp_path / "more").exists()
