"""The `toolkit` command, also as ``python -m toolkit``: the version needs no command line behind it."""

from __future__ import annotations

import sys

from toolkit.version import __version__


def main() -> None:
    """Run the command line on the words of this process."""
    if sys.argv[1:] == ["--version"]:
        print(f"toolkit {__version__}")  # noqa: T201
        return
    from toolkit.cli.main import run
    from toolkit.system import one_thread

    one_thread()
    run()


if __name__ == "__main__":
    main()
