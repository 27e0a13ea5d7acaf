"""A laboratory with candidates, an overdue check and a drift; a server of it; raw requests to that server."""

from __future__ import annotations

import contextlib
import datetime as dt
import http.client
import re
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlencode

import pytest
from playwright.sync_api import BrowserContext, sync_playwright

from tests.cli.test_calibration_control import session
from tests.workbench.kept_runner import kept_runner
from toolkit.calibration.control.calibrate import calibrate
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.registry import Registry
from toolkit.workbench.app import application
from toolkit.workbench.guard import Guard, Keys
from toolkit.workbench.server import Listening, server_of

ROOT = Path(__file__).resolve().parents[2]


CHROMIUM_WORDS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
).split()


@dataclass
class Answer:
    """What a server answered."""

    status: int
    headers: dict[str, str]
    content: bytes

    @property
    def body(self) -> str:
        return self.content.decode()

    def data(self, **attributes: str) -> list[str]:
        """Return the ``value`` of each <data> inside the first element with these attributes."""
        reader = _Values(attributes)
        reader.feed(self.body)
        return reader.values


class _Values(HTMLParser):
    def __init__(self, attributes: dict[str, str]) -> None:
        super().__init__()
        self.wanted = {f"data-{name}": value for name, value in attributes.items()}
        self.inside: list[str] = []
        self.ended = not self.wanted
        self.values: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        stated = dict(attrs)
        if self.inside:
            self.inside.append(tag)
        elif not self.values and self.wanted.items() <= stated.items():
            self.inside = [tag]
        if tag == "data" and (self.inside or not self.wanted):
            self.values.append(str(stated["value"]))

    def handle_endtag(self, tag: str) -> None:
        while self.inside and self.inside.pop() != tag:
            pass


@dataclass
class Served:
    """A workbench that is served: its guard, and requests as a browser that was let in sends them."""

    home: Path
    registry: Registry
    guard: Guard
    port: int
    cookie: str = field(init=False)

    def __post_init__(self) -> None:
        self.cookie = f"toolkit={self.guard.keys.cookie}"

    @property
    def place(self) -> str:
        return self.guard.keys.place

    def ask(
        self, path: str, method: str = "GET", body: str | bytes | None = None, **headers: str | None
    ) -> Answer:
        """Send a request; a header of None is left out. The path is sent as it stands."""
        stated: dict[str, str | None] = {"Host": self.guard.authority, "Cookie": self.cookie}
        if method == "POST":
            stated |= {"Origin": self.guard.origin, "Content-Type": "application/x-www-form-urlencoded"}
        stated |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        with contextlib.closing(connection):
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in stated.items():
                if value is not None:
                    connection.putheader(name, value)
            content = body.encode() if isinstance(body, str) else body
            if content is not None:
                connection.putheader("Content-Length", str(len(content)))
            connection.endheaders(content)
            response = connection.getresponse()
            return Answer(response.status, {k.lower(): v for k, v in response.getheaders()}, response.read())

    def page(self, path: str, **headers: str | None) -> Answer:
        """Ask for a page below the place."""
        return self.ask(self.place + path, **headers)

    def send(self, path: str, form: dict[str, str], **headers: str | None) -> Answer:
        """Send a form with its key."""
        body = urlencode({"form_key": self.guard.keys.form, **form})
        return self.ask(self.place + path, "POST", body, **headers)

    def upload(self, path: str, files: Iterable[tuple[str, str, bytes]], **fields: str) -> Answer:
        """Send a form with files (field, name, content) as a browser does."""
        boundary = "----WebKitFormBoundary7MA4YWxkTrZu0gW"
        head = f"--{boundary}\r\nContent-Disposition: form-data; name="
        parts = [
            f'{head}"{key}"\r\n\r\n{text}\r\n'.encode()
            for key, text in {"form_key": self.guard.keys.form, **fields}.items()
        ]
        for key, name, data in files:
            stated = f'{head}"{key}"; filename="{name}"\r\nContent-Type: application/octet-stream\r\n\r\n'
            parts.append(stated.encode() + data + b"\r\n")
        body = b"".join(parts) + f"--{boundary}--\r\n".encode()
        return self.ask(
            self.place + path, "POST", body, Content_Type=f"multipart/form-data; boundary={boundary}"
        )


@contextlib.contextmanager
def serving(home: Path) -> Iterator[Served]:
    """Serve a home on a free port from a thread."""
    registry, keys = Registry(home / "calibrations"), Keys()
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        bound.listen(64)
        port = bound.getsockname()[1]
        guard = Guard(application(home, registry, keys), origin=f"http://127.0.0.1:{port}", keys=keys)
        server = server_of(guard, Listening())
        thread = threading.Thread(target=server.run, kwargs={"sockets": [bound]}, daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        try:
            yield Served(home, registry, guard, port)
        finally:
            server.should_exit = True
            thread.join(20)


def filled(home: Path) -> Path:
    """Make a home: the packaged registry, a cell with seven sessions, two tests, an audit cut off."""
    shutil.copytree(ROOT / "calibrations", home / "calibrations")
    registry = Registry(home / "calibrations")
    (home / "sessions").mkdir()
    for at, error in enumerate((0.0, 0.1, -0.1, 0.05, -0.05, 0.1, 0.8)):
        entered = calibrate(session(home / "sessions" / f"s{at}", 2018 + at, error), registry)
        if at == 0:
            approve(
                registry, entered.record.id, in_force_from=dt.date(2018, 3, 1), checked_by="B",
                recall="12 months",
            )  # fmt: skip
    for name in ("a", "b"):
        (home / "tests" / name).mkdir(parents=True)
        (home / "tests" / name / "test.toml").write_text(f'schema = 1\nname = "{name}"\n')
    (home / "audit").mkdir()
    (home / "audit" / "results.jsonl").write_text('{"generator": "toolkit"}\n')
    return home


@pytest.fixture(scope="package", autouse=True)
def _jobs() -> Iterator[None]:
    with kept_runner():
        yield


@pytest.fixture(scope="package")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home to look at; nobody writes into it."""
    return filled(tmp_path_factory.mktemp("workbench") / "lab")


@pytest.fixture(scope="package")
def served(lab: Path) -> Iterator[Served]:
    """The server of `lab`."""
    with serving(lab) as bench:
        yield bench


@pytest.fixture
def own(lab: Path, tmp_path: Path) -> Iterator[Served]:
    """A server of a copy of `lab` to decide in."""
    shutil.copytree(lab, tmp_path / "lab")
    with serving(tmp_path / "lab") as bench:
        yield bench


def plain(body: str) -> str:
    """Return the text of a page without its tags."""
    return " ".join(re.sub(r"<[^>]*>", " ", body).split())


@pytest.fixture(scope="package")
def browser() -> Iterator[BrowserContext]:
    """One browser with a fresh profile for the pages of this folder."""
    with tempfile.TemporaryDirectory() as profile, sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            profile, executable_path="/usr/bin/chromium", args=CHROMIUM_WORDS, headless=True,
            viewport={"width": 1280, "height": 900},
        )  # fmt: skip
        yield context
        context.close()
