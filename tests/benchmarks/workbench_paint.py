"""The workbench's first page in a home of 1 000 records and 10 000 tests; the peer is that of an empty home.

``ready``: from the request to the page in hand. ``first paint``: what the browser itself measures. The
questions of the agenda are asked after that; a row is how long all of them take when nothing is remembered.
The last rows are of a server in a process of its own, as `toolkit open` begins it: the slowest of all pages,
and the most memory that it had once every page and every part of a record was asked for.
"""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

from tests.benchmarks.registry_growth import filled
from tests.benchmarks.timing import high_water_MB, pairs, row
from toolkit.calibration.registry.registry import Registry

RECORDS, TESTS = 1000, 10_000
LISTS = {"record": "/records", "test": "/tests/window/0"}
PAGES = ("/", "/session", "/records", "/record/{record}", "/tests", "/test/{test}", "/audits", "/diagnoses",
         "/templates", "/jobs")  # fmt: skip
PARTS = (
    *(f"/agenda/{question}" for question in ("instruments", "candidates", "due", "drift", "work")),
    *(f"/record/{{record}}/part/{part}" for part in ("gates", "responses", "fit", "budget", "as_found")),
    "/tests/windows", "/tests/window/0", "/audits/list", "/diagnoses/list",
)  # fmt: skip
"""What is asked for once its page stands."""
CHROMIUM = "/usr/bin/chromium"
_WORDS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
)


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time the first page of a large home against that of an empty one."""
    large, empty = folder / "workbench-large", folder / "workbench-empty"
    filled(large, RECORDS)
    for number in range(TESTS):
        place = large / "tests" / f"{number // 100:03}" / f"{number:05}"
        place.mkdir(parents=True)
        (place / "test.toml").write_text(f'schema = 1\nname = "test {number}"\n')
    (empty / "calibrations").mkdir(parents=True)
    pages = {home: _served(home) for home in (large, empty)}
    ask = {home: _asking(*page) for home, page in pages.items()}
    times = pairs(lambda: ask[large]("/"), lambda: ask[empty]("/"), count)
    what = f"workbench, {RECORDS} records, {TESTS} tests"
    rows = [row(f"{what}: ready", times[0], "empty home", times[1], "0.5 s")]
    rows += [row(f"{what}: first paint", *_painted(pages[large], pages[empty], count), "0.5 s")]
    started = time.perf_counter()
    for question in ("instruments", "candidates", "due", "drift", "work"):
        ask[large](f"/agenda/{question}")
    rows.append(row("its agenda, nothing remembered", [time.perf_counter() - started], "", None, ""))
    seconds, peak = _every_page(large)
    slowest = max(seconds, key=lambda page: seconds[page])
    rows.append(row(f"the slowest of all pages, {slowest}: ready", [seconds[slowest]], "", None, "0.5 s"))
    rows.append(row("memory once all was asked for", [peak], "", None, "300", unit="MB"))
    return rows


def _every_page(home: Path) -> tuple[dict[str, float], float]:
    """Return the seconds of each page of a server of its own, asked first, and its most memory [MB]."""
    program = str(Path(sys.executable).with_name("toolkit"))
    server = subprocess.Popen(
        [program, "open", str(home), "--no-browser"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True,
    )  # fmt: skip
    try:
        assert server.stdout is not None
        address = next(word for line in server.stdout for word in line.split() if "/open?key=" in word)
        with urllib.request.urlopen(address, timeout=120) as answer:  # noqa: S310  our own address
            cookie = str(answer.headers["set-cookie"]).partition(";")[0]
        ask = _asking(address, address.partition("/open?")[0], cookie)
        ids = {
            kind: re.findall(rf'/{kind}/([^/"?#]+)"', ask(path).decode())[0] for kind, path in LISTS.items()
        }
        seconds = {}
        for page in PAGES:
            started = time.perf_counter()
            ask(page.format(**ids))
            seconds[page] = time.perf_counter() - started
        for part in PARTS:
            ask(part.format(**ids))
        return seconds, high_water_MB(server.pid)
    finally:
        server.terminate()
        server.wait(30)


def _served(home: Path) -> tuple[str, str, str]:
    """Serve a home from a thread until the process ends; return its address, its place and its cookie."""
    from toolkit.workbench.app import application
    from toolkit.workbench.guard import Guard, Keys
    from toolkit.workbench.server import Listening, server_of

    bound = socket.socket()
    bound.bind(("127.0.0.1", 0))
    bound.listen(16)
    keys, origin = Keys(), f"http://127.0.0.1:{bound.getsockname()[1]}"
    guard = Guard(application(home, Registry(home / "calibrations"), keys), origin=origin, keys=keys)
    server = server_of(guard, Listening())
    threading.Thread(target=server.run, kwargs={"sockets": [bound]}, daemon=True).start()
    return guard.address, origin + keys.place, f"toolkit={keys.cookie}"


def _asking(_address: str, place: str, cookie: str) -> Callable[[str], bytes]:
    def ask(path: str) -> bytes:
        request = urllib.request.Request(place + path, headers={"Cookie": cookie})  # noqa: S310  our own address
        with urllib.request.urlopen(request, timeout=120) as answer:  # noqa: S310
            content: bytes = answer.read()
            return content

    return ask


def _painted(
    large: tuple[str, str, str], empty: tuple[str, str, str], count: int
) -> tuple[list[float], str, list[float]]:
    from playwright.sync_api import sync_playwright

    found: dict[str, list[float]] = {large[0]: [], empty[0]: []}
    with tempfile.TemporaryDirectory() as profile, sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            profile, executable_path=CHROMIUM, args=_WORDS.split(), headless=True
        )
        page = context.new_page()
        for address, place, _ in (large, empty) * (count + 1):
            # The questions of the agenda are not the page; they would run while the next one is timed.
            page.route("**/agenda/*", lambda route: route.abort())
            page.goto(address)
            page.wait_for_url(f"{place}/")
            page.goto(f"{place}/")
            page.wait_for_function("() => performance.getEntriesByName('first-contentful-paint').length")
            paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
            found[address].append(paint / 1e3)
        context.close()
    return found[large[0]][1:], "empty home", found[empty[0]][1:]
