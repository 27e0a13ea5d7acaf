"""Signing what travels: which key of the agent signs, what is shown before, where the answer goes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, TypedDict

from toolkit.errors import ConfigError, OutputError, TrustError
from toolkit.publication import publication
from toolkit.trust.keys import Signer, agent_keys, agent_signer
from toolkit.trust.people import Person, inability
from toolkit.trust.requested import Requested
from toolkit.trust.requests import Request, shown, words


class RequestedAnswer(TypedDict):
    """With ``--request``: what is to be signed was written, and nothing was entered."""

    requested: bool
    request: Annotated[str, "file that was written"]
    action: Annotated[str, "enter, approve, withdraw, discard, import, issue or enrol"]
    id: Annotated[str, "record or person"]
    takes: Annotated[str, "whose signatures it takes, in words"]


_LONGEST = 4096  # bytes of a passphrase


def request_text(request: Request) -> str:
    """Return everything that a request asks to sign, in lines for people."""
    rows = words(request)
    width = max(len(name) for name, _ in rows)
    return "\n".join(
        [f"to be signed, of {shown(str(request.path))}:", *(f"  {n:<{width}}  {t}" for n, t in rows)]
    )


def agent_signer_of(request: Request) -> Signer:
    """Return the signer of the agent's key whose owner can sign a request.

    Raises
    ------
    TrustError
        ``signing-key``: no agent, or none of its keys or several can
    """
    able = [
        key
        for key in agent_keys()
        if inability(request.version, request.action, request.time, key, request.operators) is None
    ]
    if len(able) != 1:
        raise TrustError(
            "the agent's keys do not say who signs", where=os.environ.get("SSH_AUTH_SOCK"),
            got=", ".join(key.fingerprint for key in able) or "no key that this decision takes",
            expected="a key of one person who may sign",
            next_step="name the public key, --key FILE.pub, or add the key: ssh-add FILE; nothing was signed",
            rule="signing-key",
        )  # fmt: skip
    return agent_signer(able[0])


def sign_request(request: Request, signer: Signer, out: Path | None = None) -> tuple[Path, Person]:
    """Write the answer of a signer beside the request, or to ``out``; return where, and who signed.

    Raises
    ------
    TrustError
        ``not-allowed``, ``request``; nothing is written
    OutputError
        there is such a file, or it cannot be written
    """
    answer, person = request.signed(signer)
    source = request.path or Path("request.json")
    path = out or source.with_name(f"{source.stem}.{person.id}.json")
    if path.exists():
        raise OutputError(
            "an answer is never written over a file", where=path, got="a file of that name",
            expected="a name that is free", next_step="name another with --out; nothing was signed",
            rule="not-empty",
        )  # fmt: skip
    with publication(path.parent) as stage:
        (stage / path.name).write_text(answer.text, encoding="utf-8")
    return path, person


def requested(outcome: Requested) -> tuple[RequestedAnswer, str]:
    """Return what a command says that wrote a request, as a payload and for people."""
    request = outcome.request
    payload: RequestedAnswer = {
        "requested": True, "request": str(request.path), "action": request.action, "id": request.body["id"],
        "takes": request.takes,
    }  # fmt: skip
    text = (
        f"{request.body['id']}  {request.action} requested in {request.path}; nothing was entered\n"
        f"takes {request.takes}\nnext: toolkit sign {request.path} --key KEY, where each key is; then this "
        "command again with --answer FILE in place of --request"
    )
    return payload, text


def passphrase_of(descriptor: int) -> str:
    """Return the first line that a file descriptor gives, the passphrase of a key.

    Raises
    ------
    ConfigError
        ``usage``: nothing can be read from it
    """
    data = b""
    try:
        while b"\n" not in data and len(data) < _LONGEST and (part := os.read(descriptor, _LONGEST)):
            data += part
        text = data.split(b"\n", 1)[0].decode()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            "no passphrase can be read", where=f"--passphrase-fd {descriptor}",
            got=getattr(error, "strerror", None) or "bytes that are no text",
            expected="a file descriptor that is open for reading",
            next_step="open it in the shell: toolkit sign ... --passphrase-fd 3 3< FILE", rule="usage",
        ) from error  # fmt: skip
    return text
