"""The wheel as a laboratory has it: everything in it, installed without root, used from another folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.built_once import built_once
from toolkit.version import DISTRIBUTION, __version__

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HEAVY = {"numpy", "scipy", "pandas", "matplotlib", "statsmodels", "pint", "openpyxl", "docx", "lxml", "rich"}


def files_below(folder: Path) -> set[str]:
    files = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(folder).as_posix() for path in files}


def build(folder: Path) -> None:
    from hatchling.builders.sdist import SdistBuilder
    from hatchling.builders.wheel import WheelBuilder

    for builder in (WheelBuilder, SdistBuilder):
        list(builder(str(ROOT)).build(directory=str(folder), versions=["standard"]))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The distributions without the site, whose making takes longer than all else."""

    def bare(folder: Path) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("HATCH_BUILD_NO_HOOKS", "true")
            build(folder)

    return built_once(tmp_path_factory, "bare", bare)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The distributions as they are released."""
    # Once for all workers: the site in it is made in one place of the checkout.
    return built_once(tmp_path_factory, "dist", build)


def installed(folder: Path, built: Path) -> Path:
    """Return a new environment with nothing of the toolkit but a wheel; it shares the libraries."""
    venv.create(folder, with_pip=False)
    site = next(folder.glob("lib/python*/site-packages"))
    libraries = Path(np.__file__).parents[1]
    # A folder that a .pth file names is searched; .pth files in it, an editable install's too, are not read.
    (site / "libraries.pth").write_text(f"{libraries}\n")
    wheel = next(built.glob("*.whl"))
    pip = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(folder / "bin" / "python"),
        "--disable-pip-version-check",
    ]
    subprocess.run(
        [*pip, "install", "--quiet", "--no-deps", "--no-index", "--no-compile", str(wheel)],
        check=True,
        env=clean(folder),
    )
    return folder


def clean(home: Path) -> dict[str, str]:
    """Return this process's variables without those that could lead back to the checkout or to its tests."""
    gone = {"PYTHONPATH", "TOOLKIT_HOME", "TOOLKIT_SOFFICE", "VIRTUAL_ENV"}
    return {name: text for name, text in os.environ.items() if name not in gone} | {"HOME": str(home)}


def test_the_name_is_stated_everywhere() -> None:
    assert PROJECT["name"] == DISTRIBUTION
    assert f'pip install "{DISTRIBUTION}[' in (ROOT / "README.md").read_text()
    assert f"{DISTRIBUTION}[tdms]" in (ROOT / "toolkit" / "lab" / "rules.toml").read_text()


def test_the_version_is_stated_everywhere() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {__version__}\n" in citation
    released = re.search(r"(?m)^date-released: (.*)$", citation)
    assert released is not None
    assert f"\n## [{__version__}] - {released[1]}\n" in (ROOT / "CHANGELOG.md").read_text()
    for page in ("README.md", "docs/install.md"):
        assert f"tire_lab_toolkit-{__version__}-py3-none-any.whl" in (ROOT / page).read_text()


SITE = pytest.mark.campaign(
    "the wheel with its site, which Sphinx makes: every run builds and installs it without"
)


@pytest.mark.parametrize("kind", ["built", pytest.param("whole", marks=SITE)])
def test_the_wheel_holds_every_file_of_the_package_and_of_the_home(
    request: pytest.FixtureRequest, kind: str
) -> None:
    (wheel,) = request.getfixturevalue(kind).glob("*.whl")
    assert wheel.name == f"{DISTRIBUTION.replace('-', '_')}-{__version__}-py3-none-any.whl"
    with zipfile.ZipFile(wheel) as archive:
        inside = {name for name in archive.namelist() if ".dist-info/" not in name}
        metadata = archive.read(f"{wheel.name.rsplit('-', 3)[0]}.dist-info/METADATA").decode()
    expected = {f"toolkit/{name}" for name in files_below(ROOT / "toolkit")}
    for home in ("calibrations", "report_templates"):
        expected |= {f"toolkit/_home/{home}/{name}" for name in files_below(ROOT / home)}
    if kind == "whole":
        expected |= {f"toolkit/_site/{name}" for name in files_below(ROOT / "build" / "docs")}
    assert inside == expected
    assert f"Name: {DISTRIBUTION}\n" in metadata
    assert {f"Provides-Extra: {extra}" for extra in ("tdms", "mdf", "parquet", "cluster")} <= set(
        metadata.splitlines()
    )


@SITE
def test_the_site_asks_no_other_host(whole: Path) -> None:
    (wheel,) = whole.glob("*.whl")
    asked = re.compile(
        r"""(?:<(?:script|link|img|iframe)[^>]*(?:src|href)=["']|url\(["']?|@import ["'])https?:"""
    )
    with zipfile.ZipFile(wheel) as archive:
        pages = [name for name in archive.namelist() if name.startswith("toolkit/_site/")]
        texts = {name: archive.read(name).decode() for name in pages if name.endswith((".html", ".css"))}
        size = sum(archive.getinfo(name).compress_size for name in pages)
    assert len(texts) > 50
    assert not [name for name, text in texts.items() if asked.search(text)]
    assert size < 2_000_000


def test_the_source_distribution_holds_what_builds_and_tests_it(built: Path) -> None:
    (source,) = built.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "Makefile", "requirements.lock"} <= inside
    assert {f"toolkit/{name}" for name in files_below(ROOT / "toolkit")} <= inside
    assert {f"calibrations/{name}" for name in files_below(ROOT / "calibrations")} <= inside
    assert "tests/test_wheel.py" in inside


@pytest.mark.parametrize("kind", ["built", pytest.param("whole", marks=SITE)])
def test_the_whole_path_from_another_folder(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path, kind: str
) -> None:
    """A home by the installed command, from the package's own records and templates.

    The ``whole`` wheel goes on: its pages, a session, its record, a test and its report, and the
    demonstration, which goes these steps by itself.
    """
    environment = installed(tmp_path_factory.mktemp("environment"), request.getfixturevalue(kind))
    program = environment / "bin" / "toolkit"

    def run(*words: object, codes: tuple[int, ...] = (0,)) -> str:
        done = subprocess.run(
            [program, *map(str, words)], cwd=tmp_path, env=clean(tmp_path), capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        assert done.returncode in codes, f"{words}\n{done.stdout}{done.stderr}"
        return done.stdout

    python = [environment / "bin" / "python", "-c", "import toolkit; print(toolkit.__file__)"]
    place = subprocess.run(
        python, cwd=tmp_path, env=clean(tmp_path), capture_output=True, text=True, check=True
    )
    assert Path(place.stdout.strip()).is_relative_to(environment)
    assert run("--version").strip() == f"toolkit {__version__}"
    assert "--no-browser" in run("open", "--help")
    package = Path(place.stdout.strip()).parent
    examples = package / "examples" / "virtual"
    run("init", "lab")
    assert (tmp_path / "lab" / "report_templates" / "org.docx").is_file()
    records = run("calibration", "list", "--calibrations", package / "_home" / "calibrations")
    assert "m15-virtual-r1" in records
    if kind == "whole":
        page = Path(run("docs", "--no-browser").strip())
        assert page.is_relative_to(environment)
        assert "Tutorials" in page.read_text()
        run("simulate", examples / "session_plan.toml", "--out", "session", "--home", "lab")
        run("calibrate", "session/SESSION.toml", "--home", "lab")
        run("calibration", "approve", "m15-virtual-r1", "--in-force-from", "2026-03-03", "--checked-by",
            "second person", "--reason", "the first record of this home", "--home", "lab")  # fmt: skip
        run("simulate", examples / "test_plan.toml", "--out", "test", "--home", "lab")
        run("process", "test", "--out", "test.xlsx", "--home", "lab", codes=(1,))
        run("report", "test.xlsx", "--template", "lab/report_templates/org.docx", "--out", "out",
            "--home", "lab", codes=(1,))  # fmt: skip
        assert {path.suffix for path in (tmp_path / "out").iterdir()} >= {".docx", ".pdf"}
        assert "verified: True" in run("demo", "--out", "demo")


def test_help_needs_no_library_of_numbers_or_documents() -> None:
    words = [["--help"], ["--version"], *([group, "--help"] for group in ("calibration", "fit", "open"))]
    for each in words:
        code = (
            f"import sys; sys.argv[1:] = {each}\nfrom toolkit.__main__ import main\n"
            "try: main()\nexcept SystemExit: pass\n"
            "print(*sorted(sys.modules), file=sys.stderr)"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout
        assert HEAVY.isdisjoint(done.stderr.split()), each
    assert "typer" in done.stderr.split()
