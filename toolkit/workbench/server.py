"""The server: one address of this computer, opened in the person's browser, ended by Ctrl-C."""

from __future__ import annotations

import socket
import tempfile
import webbrowser
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError
from toolkit.inputs import CERTIFICATE_FILE, read_input
from toolkit.workbench.guard import Doors, Guard, Keys
from toolkit.workbench.page import bare_page

if TYPE_CHECKING:
    import uvicorn

    from toolkit.calibration.registry.registry import Registry
    from toolkit.trust.people import Person

LOOPBACK = "127.0.0.1"
Addresses = Mapping[str | None, str]
"""The addresses that let in, by the person whom each lets in; None: the user of this computer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Listening:
    """Where the server listens.

    ``host`` other than the loopback interface needs ``certificate`` and ``key``, PEM files, and people: what
    is decided over a network is signed, and nobody on the way reads the key of the address.
    """

    host: str = LOOPBACK
    port: int = 0
    certificate: Path | None = None
    key: Path | None = None

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer reaches it."""
        return self.host == LOOPBACK

    def origin(self, port: int) -> str:
        """Return the origin of the pages at the port that the system gave."""
        return f"{'http' if self.certificate is None else 'https'}://{self.host}:{port}"


def check_listening(listening: Listening, registry: Registry) -> None:
    """Refuse an address that other computers reach, unless it is sealed and decisions are signed.

    Raises
    ------
    ConfigError
        ``workbench-host``
    """
    if (listening.certificate is None) != (listening.key is None):
        raise _refused("a certificate without its key, or a key alone", "--certificate FILE and --key FILE")
    if listening.is_loopback:
        return
    if listening.certificate is None:
        raise _refused(
            f"--host {listening.host} without a certificate", "--certificate FILE and --key FILE, PEM"
        )
    if registry.people().history.now is None:
        raise _refused(
            f"--host {listening.host} where nobody is enrolled",
            "people with keys, so that each decision is signed: toolkit person enrol",
        )


def serve(
    home: Path, registry: Registry, listening: Listening, *, browser: bool, say: Callable[[Addresses], None]
) -> None:
    """Serve the workbench of a home until Ctrl-C; ``say`` is told the addresses once they answer.

    Raises
    ------
    ConfigError
        ``workbench-host``; ``workbench-port``: the address is taken, or is none of this computer
    """
    check_listening(listening, registry)
    with _bound(listening) as bound, tempfile.TemporaryDirectory(prefix="toolkit-open-") as private:
        guards = guards_of(home, registry, listening, listening.origin(bound.getsockname()[1]))
        server = server_of(Doors(tuple(guards.values())), listening)
        say({person: guard.address for person, guard in guards.items()})
        if browser and None in guards:
            webbrowser.open(_way_in(Path(private), guards[None].address).as_uri())
        try:
            server.run(sockets=[bound])
        except KeyboardInterrupt:
            return


def guards_of(home: Path, registry: Registry, listening: Listening, origin: str) -> dict[str | None, Guard]:
    """Return who is let in: the server's own user, or each person who is enrolled, by id, with own keys.

    Whose keys were all revoked since is let in no more, whatever address or cookie that person has.
    """
    from toolkit.workbench.app import application

    if listening.is_loopback:
        keys = Keys()
        return {None: Guard(application(home, registry, keys), origin=origin, keys=keys)}
    guards: dict[str | None, Guard] = {}
    for person in signing_people(registry):
        keys = Keys()
        guards[person.id] = Guard(
            application(home, registry, keys, person=person), origin=origin, keys=keys,
            is_open=partial(_signs, registry, person.id),
        )  # fmt: skip
    return guards


def signing_people(registry: Registry) -> tuple[Person, ...]:
    """Return the people who sign now."""
    version, now = registry.people().history.now, registry.now()
    people = () if version is None else version.people.person
    return tuple(person for person in people if any(key.valid_at(now) for key in person.keys))


def _signs(registry: Registry, person_id: str) -> bool:
    return any(person.id == person_id for person in signing_people(registry))


def server_of(guard: Guard | Doors, listening: Listening) -> uvicorn.Server:
    """Return the server of guarded pages: plain HTTP, no web sockets, nothing written to the terminal.

    Raises
    ------
    ConfigError
        ``workbench-host``: the certificate cannot be used
    TrustError
        a file of the two cannot be read
    """
    import uvicorn

    for path in (listening.certificate, listening.key):
        if path is not None:
            read_input(path, CERTIFICATE_FILE)  # ssl would wait for a pipe
    config = uvicorn.Config(
        guard, log_config=None, access_log=False, server_header=False, lifespan="off", ws="none",
        http="h11", loop="asyncio", timeout_graceful_shutdown=2, proxy_headers=False,
        ssl_certfile=listening.certificate, ssl_keyfile=listening.key,
        ssl_keyfile_password="",  # an encrypted key would be asked for at the terminal
    )  # fmt: skip
    try:
        config.load()
    except OSError as error:  # that of ssl is one
        raise ConfigError(
            "the certificate cannot be used", where=listening.certificate, got=error.strerror or error,
            expected="a certificate and its private key without passphrase, PEM",
            next_step="check --certificate and --key", rule="workbench-host",
        ) from error  # fmt: skip
    return uvicorn.Server(config)


def _bound(listening: Listening) -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((listening.host, listening.port))
        bound.listen(128)  # a browser that is opened now waits until the server answers
    except OSError as error:
        bound.close()
        raise ConfigError(
            "the workbench cannot listen there", where=f"{listening.host}:{listening.port}",
            got=error.strerror or error, expected="a free port of this computer",
            next_step="leave --port out, and a free one is taken", rule="workbench-port",
        ) from error  # fmt: skip
    return bound


def _way_in(folder: Path, address: str) -> Path:
    """Return a page that leads to the address, in a folder of this user alone.

    The command line of a browser is read by every user of the computer: the key must not stand in it.
    """
    page = folder / "workbench.html"
    page.write_text(bare_page("way_in", address=address), encoding="utf-8")
    return page


def _refused(got: str, expected: str) -> ConfigError:
    return ConfigError(
        "the workbench is not opened to other computers like this", where="--host", got=got,
        expected=expected,
        next_step="leave --host out: the workbench is then for this computer alone", rule="workbench-host",
    )  # fmt: skip
