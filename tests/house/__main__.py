"""`python -m tests.house [--json] [--names toolkit/PACKAGE] [--list FIGURE]`: the house in figures."""

from __future__ import annotations

import argparse
import dataclasses
import gc
import json
import sys
from pathlib import Path
from typing import Any

from tests.house import citations, structure, weight, words
from tests.house.source import ROOT, Module, read_package

LISTS = ("commands", "effects", "arrows", "pages", "once", "twice", "alone")

_HEAVIEST = 10


def measure(root: Path = ROOT) -> dict[str, Any]:
    """Return every figure of a checkout, with what it counts."""
    modules = read_package(root)
    graph = structure.import_graph()
    total, longest = words.share_of(modules), structure.largest(modules)
    worst = sorted(modules, key=lambda module: -words.share_of([module]).vague)[:15]
    effects, twice = citations.effects_named(modules), weight.written_twice(modules)
    return {
        "schema": 1,
        "lines": sum(len(module.lines) for module in modules),
        "modules": len(modules),
        "layers": [dataclasses.asdict(layer) for layer in structure.sizes(modules, root)],
        "median_lines": structure.median_lines(modules),
        "largest": {"module": longest.name, "lines": len(longest.lines)},
        "names": {
            "bound": total.bound,
            "vague": total.vague,
            "percent": round(total.percent, 2),
            "commonest": dict(words.commonest(modules, 20)),
            "worst": [_share(module) for module in worst],
            "layers": {
                layer.name: round(words.share_of([m for m in modules if m.layer == layer.name]).percent, 2)
                for layer in structure.sizes(modules, root)
            },
        },
        "public_names": structure.public_names(root),
        "cli_without_command": structure.without_command(modules),
        "effects_named_outside": {
            "mentions": [dataclasses.asdict(mention) for mention in effects],
            "modules": len({mention.place for mention in effects}),
        },
        "arrows_up": {
            room: [dataclasses.asdict(arrow) for arrow in structure.arrows_up(graph, room, root)]
            for room in structure.ROOMS
        },
        "pages_missing": [dataclasses.asdict(m) for m in citations.pages_missing(root)],
        "imported_once": [
            {"module": module, "importer": importer} for module, importer in structure.imported_once(graph)
        ],
        "uncalled": weight.uncalled(modules, root),
        "written_twice": {"lines": weight.repeated_lines(twice), "functions": twice},
        "needed_by_one": [dataclasses.asdict(row) for row in weight.needed_by_one(modules)],
    }


def _share(module: Module) -> dict[str, Any]:
    share = words.share_of([module])
    return {"module": module.name, "vague": share.vague, "percent": round(share.percent, 1)}


def text_of(figures: dict[str, Any]) -> str:
    """Return the figures as a page of text."""
    names, mentions = figures["names"], figures["effects_named_outside"]
    vague = names["layers"]
    rows = [f"{'layer':<18}{'lines':>8}{'modules':>9}{'vague names':>13}"]
    rows += [
        f"{layer['name']:<18}{layer['lines']:>8}{layer['modules']:>9}{vague[layer['name']]:>11.1f} %"
        for layer in figures["layers"]
    ]
    rows += [f"{'all':<18}{figures['lines']:>8}{figures['modules']:>9}{names['percent']:>11.1f} %", ""]
    largest = figures["largest"]
    aims = [
        ("median lines of a module", f"{figures['median_lines']:g}", "170"),
        ("largest module", f"{largest['lines']} lines, {largest['module']}", "500"),
        ("vague names", f"{names['vague']} of {names['bound']}, {names['percent']} %", "2.5 %"),
        ("public names of toolkit", f"{len(figures['public_names'])}", "20"),
        ("modules of cli without a command", f"{len(figures['cli_without_command'])}", "0"),
        ("effects named outside their file",
         f"{len(mentions['mentions'])} times in {mentions['modules']} modules", "0"),
        *((f"imports up the layers in {room}", f"{len(arrows)}", "0")
          for room, arrows in figures["arrows_up"].items()),
        ("pages cited that do not exist", f"{len(figures['pages_missing'])}", "0"),
        ("modules imported from one place", f"{len(figures['imported_once'])}", ""),
        ("functions that nobody calls", f"{len(figures['uncalled'])}", "0"),
        ("lines of functions written twice", f"{figures['written_twice']['lines']}", "0"),
    ]  # fmt: skip
    rows += [f"{title:<36}{value}" + (f"  (aim {aim})" if aim else "") for title, value, aim in aims]
    rows += ["", "commonest  " + ", ".join(f"{name} {count}" for name, count in names["commonest"].items())]
    rows += [f"{row['vague']:>5}{row['percent']:>7.1f} %  {row['module']}" for row in names["worst"]]
    rows += ["", "lines and modules that the commands of one module alone need"]
    rows += [
        f"{row['lines']:>6}{row['modules']:>5}  {row['command']}"
        for row in figures["needed_by_one"][:_HEAVIEST]
    ]
    return "\n".join(rows)


def names_text(package: Path, root: Path = ROOT) -> str:
    """Return every vague name below a path: file and line, scope, name, and the line itself."""
    folder = package.as_posix().rstrip("/")
    rows = []
    for module in read_package(root):
        path = module.path.as_posix()
        if path == folder or path.startswith(f"{folder}/"):
            for found in words.vague_bindings(module):
                line = module.lines[found.line - 1].strip()
                rows.append(f"{path}:{found.line}\t{found.scope or '*'}\t{found.name}\t{line}")
    return "\n".join(rows)


def _list_text(figures: dict[str, Any], figure: str) -> str:
    rows = {
        "commands": figures["cli_without_command"],
        "effects": figures["effects_named_outside"]["mentions"],
        "arrows": [arrow for arrows in figures["arrows_up"].values() for arrow in arrows],
        "pages": figures["pages_missing"],
        "once": figures["imported_once"],
        "twice": ["\t".join(places) for places in figures["written_twice"]["functions"]],
        "alone": figures["needed_by_one"],
    }[figure]
    return "\n".join(row if isinstance(row, str) else "\t".join(map(str, row.values())) for row in rows)


def main(arguments: list[str] | None = None) -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(prog="python -m tests.house", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON document, with everything counted")
    parser.add_argument("--names", type=Path, metavar="PATH", help="vague names below toolkit/PACKAGE")
    parser.add_argument("--list", choices=LISTS, help="what a figure counts, line by line")
    options = parser.parse_args(arguments)
    gc.disable()  # a million nodes of syntax trees that live to the end: collecting costs a third of the time
    if options.names:
        print(names_text(options.names))  # noqa: T201
        return 0
    figures = measure()
    if options.json:
        print(json.dumps(figures, indent=1))  # noqa: T201
    else:
        print(_list_text(figures, options.list) if options.list else text_of(figures))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
