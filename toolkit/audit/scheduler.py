"""The scheduler of a cluster: whether one answers at an address, and with which certificates.

``tcp://host:port`` is plain. ``tls://host:port`` is encrypted, and both sides show a certificate: dask's own
configuration names them, here as for its schedulers and workers. This toolkit makes no certificates and has
no options for them.
"""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from toolkit.errors import ConfigError

CONNECT_S = 10.0
_SECTION = "distributed.comm.tls"
_NEEDED = (("tls_ca_file", "ca-file"), ("tls_client_cert", "client.cert"))
_FILES = (*_NEEDED, ("tls_client_key", "client.key"))  # the key may stand in the certificate's file
_GREETING = 0.8  # of the time to connect: its own words say more than that the time is over


def security_of(distributed: Any, address: str) -> Any:
    """Return dask's security settings for an address, as its configuration has them.

    Raises
    ------
    ConfigError
        ``cluster``: ``tls://``, and the configuration lacks a certificate or names one that cannot be used
    """
    try:
        security = distributed.Security()
        if address.startswith("tls:"):
            _check_files(security, address)
        security.get_connection_args("client")
    except (OSError, ValueError) as error:  # an SSLError is an OSError
        raise trouble(
            address,
            f"certificates that cannot be used: {error}",
            f"{_SECTION} in dask's configuration: PEM files of ca-file, client.cert, client.key",
            "correct the files or the configuration; 'dask config list' shows it",
        ) from error
    return security


def _check_files(security: Any, address: str) -> None:
    lacking = [f"{_SECTION}.{key}" for field, key in _NEEDED if not getattr(security, field)]
    lack = f"dask's configuration without {' and '.join(lacking)}"
    if not lacking:
        files = [(key, str(getattr(security, field) or "")) for field, key in _FILES]
        absent = [f"{key} {text}" for key, text in files if text and "\n" not in text and not _there(text)]
        if not absent:
            return
        lack = f"no such file: {', '.join(absent)}"
    raise trouble(
        address,
        lack,
        "for tls://, the certificate authority and the client's certificate and key in dask's configuration",
        f"name {_SECTION}.ca-file, .client.cert and .client.key in ~/.config/dask/distributed.yaml, or set "
        "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..__CLIENT__CERT and ..__CLIENT__KEY",
    )


def _there(text: str) -> bool:
    return Path(text).is_file()


def unreachable(distributed: Any, address: str, security: Any) -> str | None:
    """Return why no scheduler answers at an address, None where one does.

    A client asks whoever is there, and would wait for an answer without end.
    """
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
        if parts.scheme not in ("tcp", "tls") or not host or port is None:
            return f"{address!r}, which is no address of a scheduler"
        socket.create_connection((host, port), timeout=CONNECT_S).close()
        asyncio.run(asyncio.wait_for(_greeted(distributed, address, security), CONNECT_S))
    except TimeoutError:
        return f"no answer within {CONNECT_S:g} s"
    except (OSError, ValueError, RuntimeError) as error:
        cause = error.__cause__
        return f"{error}" + (f" ({cause})" if cause is not None and str(cause) not in str(error) else "")
    return None


async def _greeted(distributed: Any, address: str, security: Any) -> None:
    words = security.get_connection_args("client")
    comm = await distributed.core.connect(address, timeout=_GREETING * CONNECT_S, **words)
    await comm.close()


def trouble(address: str, got: str, expected: str, next_step: str) -> ConfigError:
    """Return the error of a cluster that cannot be used."""
    return ConfigError(
        "the cluster cannot be used", where=f"--scheduler {address}", got=got, expected=expected,
        next_step=next_step, rule="cluster",
    )  # fmt: skip
