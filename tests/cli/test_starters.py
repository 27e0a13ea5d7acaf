"""`toolkit session|machine|test|case|plan new`: from an empty folder to a file that its command accepts."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests import commands
from tests.declared.test_describe_filled_in import Lines, without_sign
from toolkit.calibration.session.read import read_session
from toolkit.declared import read
from toolkit.declared.describe import asked_of, filled_in
from toolkit.diagnosis.case.reader import read_case
from toolkit.errors import ConfigError, ToolkitError
from toolkit.lab.home import packaged_home
from toolkit.lab.starters import FORMS, form_of
from toolkit.machine import load_machine
from toolkit.recording.folder import read_test_folder
from toolkit.simulation.plan import read_plan

BELT = [
    "name=belt-2", "title=Flat belt 2", "kind=real", "axes=ISO-W", 'rotations=["forward"]',
    "drum.surface=flat belt", 'drum.speed={value=60,unit="km/h"}',
    'drum.speed_tolerance={value=1,unit="km/h"}', "protocol.source=own",
    'protocol.slip_angles={value=[-4,0,4],unit="deg"}', 'protocol.loads={value=[2,4],unit="kN"}',
    'protocol.slip_angle_tolerance={value=0.5,unit="deg"}', "protocol.load_tolerance=0.05",
    "protocol.settle_revolutions=1", "protocol.average_revolutions=1", "protocol.acquisition=after_settling",
]  # fmt: skip
LOADS = "run,direction,gx [mV/V],gy (mV/V),FY [kN],MZ [N*m],remark\n" + "".join(
    f"{i // 6 + 1},up,{x},{y},{2 * x + 0.01 * y + 1e-5 * (-1) ** i},{30 * y - x + 1e-3 * (-1) ** (i // 2)},\n"
    for i, (x, y) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1), (2, -1), (-1, 2)] * 6)
)


def sets(entries: list[str]) -> list[str]:
    return [word for entry in entries for word in ("--set", entry)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("word", FORMS)
def test_what_is_missing_is_told_all_at_once_by_the_command_and_by_the_reader(
    word: str, folder: Path
) -> None:
    code, told = commands.answer(word, "new", "f.toml")
    assert code == 0
    assert told["open"]
    with pytest.raises(ConfigError) as caught:
        read(form_of(word), folder / "f.toml")
    asked = asked_of(form_of(word), {})  # by whoever works with the file, not by its reader
    assert asked.keys() <= {*told["open"]}
    assert all(name in str(caught.value) for name in told["open"] if name not in asked)


@pytest.mark.parametrize("word", FORMS)
def test_nothing_is_written_over_and_nothing_wrong_is_written(word: str, folder: Path) -> None:
    (folder / "mine.toml").write_text("mine")
    for words, rule in (
        (["mine.toml"], "not-writable"),
        (["new.txt"], "not-writable"),
        (["new.toml", "--set", "nonsense=1"], "unknown-key"),
        (["new.toml", "--set", "nonsense"], "usage"),
    ):
        code, told = commands.answer(word, "new", *words)
        assert (code, told["error"]["rule"]) == (2, rule), told
    assert {path.name for path in folder.iterdir()} == {"mine.toml"}
    assert (folder / "mine.toml").read_text() == "mine"


def test_a_session_of_a_table_is_accepted_by_calibrate(folder: Path) -> None:
    (folder / "data").mkdir()
    (folder / "data" / "loads.csv").write_text(LOADS.replace(",remark", "").replace(",\n", "\n"))
    assert commands.said("init", ".").code == 0
    words = ["--set", "instrument=press-7", "--set", "date=2026-02-03", "--set", "operator=first person"]
    code, told = commands.answer("session", "new", "SESSION.toml", "--from", "data/loads.csv", *words)
    assert (code, told["open"], told["not_guessed"]) == (0, [], [])
    assert told["guessed"] == {
        "data": "data/loads.csv", "indications": ["gx", "gy"], "loads": ["FY", "MZ"],
    }  # fmt: skip
    code, told = commands.answer("calibrate", "SESSION.toml")
    assert code in (0, 1), told
    assert told["record"]["id"] == "press-7-r1"


def test_what_no_header_tells_is_said_and_left_out(folder: Path) -> None:
    (folder / "loads.csv").write_text(LOADS)
    _, told = commands.answer("session", "new", "s.toml", "--from", "loads.csv")
    assert told["not_guessed"] == ["remark: no unit that is known; write 'NAME [unit]'"]
    assert told["open"] == ["instrument", "date", "operator"]
    # What `calibrate` would refuse is to be mended, and not "nothing must be filled in".
    assert told["lacking"] == {
        "data": "loads.csv may not have remark: a session's table has no columns of other use"
    }
    # Cells that are read in units of force: no unit tells them from the loads.
    (folder / "lbf.csv").write_text("run,direction,A [lbf],B [lbf],FY [N]\n1,up,0,0,0\n")
    _, told = commands.answer("session", "new", "t.toml", "--from", "lbf.csv")
    assert set(told["guessed"]) == {"data"}
    assert {"indications", "loads"} <= set(told["open"])
    assert told["lacking"] == {}
    (folder / "bare.csv").write_text("A [mV/V],FY [N]\n0,0\n")
    _, told = commands.answer("session", "new", "u.toml", "--from", "bare.csv")
    assert told["open"] == ["instrument", "date", "operator"]
    assert told["lacking"] == {"data": "bare.csv needs the column run and the column direction"}


@pytest.mark.parametrize("word", ["session", "machine"])
def test_rows_without_a_header_say_nothing_of_columns(word: str, folder: Path) -> None:
    (folder / "bare.csv").write_text("23682,-0.31,9.44\n23780,-0.26,9.47\n")
    code, answer = commands.answer(word, "new", "s.toml", "--from", "bare.csv")
    assert (code, answer["error"]["rule"]) == (2, "no-header")
    assert not (folder / "s.toml").exists()


def test_the_machine_of_a_recording_reads_it_whatever_form_its_units_have(folder: Path) -> None:
    (folder / "foreign.csv").write_text("SA (deg),FZ_N,FY / N,MZ in Nm,TT [degC]\n1,3000,-500,20,40\n")
    code, _ = commands.answer("machine", "new", "r.toml", "--from", "foreign.csv", *sets(BELT))
    assert code == 0
    code, answer = commands.answer("inspect", "foreign.csv", "--machine", "r.toml")
    channels = {channel["symbol"]: channel["unit"] for channel in answer["channels"]}
    assert channels == {"SA": "deg", "FZ": "N", "FY": "N", "MZ": "N*m", "TT": "degC"}


def test_a_temperature_is_no_time(folder: Path) -> None:
    (folder / "run_01.csv").write_text("Time [ms],Fz [kN],SA [deg],gx [mV/V],T [degC]\n0,1,0,0,21\n")
    code, _ = commands.answer("machine", "new", "belt.toml", "--from", "run_01.csv", *sets(BELT))
    assert code == 0
    columns = load_machine("belt.toml").columns
    assert [(column.symbol, column.role) for column in columns if column.header in ("Time", "T")] == [
        ("t", "time"),
        ("T", "covariate"),
    ]


def test_a_belt_by_a_recording_of_it(folder: Path) -> None:
    (folder / "run_01.csv").write_text("Fz [kN],SA [deg],gx [mV/V],gy [mV/V],FY [N]\n1,0,0,0,0\n")
    code, told = commands.answer("machine", "new", "belt.toml", "--from", "run_01.csv", *sets(BELT))
    # A drum's owner is told what nobody asks a belt's for: without it the road would count as flat.
    assert [text for text in told["not_guessed"] if text.startswith("drum.circumference: ")] != []
    assert (code, told["open"]) == (0, [])
    machine = load_machine("belt.toml")
    roles = {column.symbol: (column.unit, column.role) for column in machine.columns}
    assert roles == {
        "FZ": ("kN", "load"), "SA": ("deg", "slip_angle"), "gx": ("mV/V", "indication"),
        "gy": ("mV/V", "indication"), "FY": ("N", "acquired"),
    }  # fmt: skip
    assert commands.said("machine", "show", "belt.toml").code == 0
    words = ("--set", "machine=belt.toml", "--set", "date=2026-03-17")
    assert commands.said("test", "new", "test.toml", *words).code == 0
    assert load_machine(read_test_folder(folder).info.machine).name == "belt-2"


def test_a_case_shows_every_kind_of_simulation_and_the_chosen_one_alone(folder: Path) -> None:
    assert commands.answer("case", "new", "any.toml")[0] == 0
    text = (folder / "any.toml").read_text()
    assert [f'#kind = "{kind}"' in text for kind in ("machine", "python", "ode", "columns")] == [True] * 4
    _, answer = commands.answer("case", "new", "ode.toml", "--set", "simulation.kind=ode")
    text = (folder / "ode.toml").read_text()
    assert "simulation.path" in answer["open"]
    assert '#path = "sim.py"   # FILL IN' in text
    assert "#states = " in text
    assert "function" not in text


def test_a_case_of_a_recording_names_its_channels_and_leaves_open_what_no_header_tells(folder: Path) -> None:
    rows = "".join(f"{i},{i % 5},3000,{-900 * (i % 5)},{-890 * (i % 5)},7\n" for i in range(40))
    (folder / "r.csv").write_text(f"Time [s],SA [deg],FZ [N],FY [N],FY_sim,x [m]\n{rows}")
    code, told = commands.answer("case", "new", "c.toml", "--from", "r.csv")
    assert (code, told["open"]) == (0, [])
    assert told["not_guessed"] == ["x: an input, an output or a covariate of the simulation"]
    channels = {channel.name: (channel.unit, channel.role) for channel in read_case(Path("c.toml")).channels}
    assert channels == {
        "Time": ("s", "time"), "SA": ("deg", "input"), "FZ": ("N", "input"), "FY": ("N", "output"),
        "x": ("m", "input"),
    }  # fmt: skip
    assert told["guessed"]["simulation"] == {"kind": "columns", "simulated": {"FY": "FY_sim"}}
    # What somebody states goes before a guess, which is then none.
    _, told = commands.answer("case", "new", "p.toml", "--from", "r.csv", "--set", "simulation.kind=python")
    assert (set(told["guessed"]), told["open"]) == ({"recording"}, ["simulation.path"])


def test_every_column_of_numbers_is_a_channel_of_a_new_case(folder: Path) -> None:
    (folder / "part1.csv").write_text("t,gas,co2 [%],operator\n0,-0.1,53.8,first\n9,0,53.6,first\n")
    words = ("--from", "part1.csv", "--set", "simulation.kind=python", "--set", "simulation.path=sim.py")
    _, told = commands.answer("case", "new", "f.toml", *words)
    assert told["guessed"]["recording"]["channels"] == {
        "t": {"unit": "s", "role": "time"}, "gas": {"role": "input"}, "co2": {"unit": "%", "role": "input"},
    }  # fmt: skip
    assert told["open"] == ["recording.channels.gas.unit"]
    assert list(told["lacking"]) == ["recording.channels"]
    assert "operator: it holds texts, and is no channel" in told["not_guessed"]
    text = (folder / "f.toml").read_text()
    assert "\n[recording.channels]\n" in text
    assert '\ngas = { role = "input" }   # FILL IN: unit\n' in text
    assert "t is the time, in s where its header states no unit" in text.replace("\n# ", " ")
    # Filled in as the file and the command say, it is a case.
    text = text.replace('{ role = "input" }   # FILL IN: unit', '{ unit = "1", role = "input" }')
    (folder / "f.toml").write_text(text.replace('unit = "%", role = "input"', 'unit = "%", role = "output"'))
    (folder / "sim.py").write_text("def simulate(inputs, p): ...\n")
    assert [channel.role for channel in read_case(Path("f.toml")).channels] == ["time", "input", "output"]


def test_a_case_whose_outputs_no_header_tells_is_begun_and_asks_for_them(folder: Path) -> None:
    (folder / "r.csv").write_text("t [s],x [m]\n0,1\n1,2\n")
    code, told = commands.answer(
        "case", "new", "c.toml", "--from", "r.csv", "--set", "simulation.kind=machine"
    )
    assert (code, told["open"]) == (0, ["recording.channels"])


def test_a_plan_is_read(folder: Path) -> None:
    _, told = commands.answer("plan", "new", "plan.toml")
    entries = ["date=2026-03-17", "tire.file=tire.tir", "tire.size=205/55R16", "seed=7"]
    examples = Path(load_machine.__code__.co_filename).parents[1] / "examples" / "virtual"
    (folder / "tire.tir").write_bytes((examples / "tire.tir").read_bytes())
    needed = [entry for entry in entries if entry.partition("=")[0] in told["open"]]
    _, told = commands.answer("plan", "new", "whole.toml", *sets(needed))
    assert told["open"] == []
    assert read_plan(folder / "whole.toml").seed is not None


def test_a_person_is_asked_for_what_must_be_stated(folder: Path) -> None:
    words = [sys.executable, "-m", "toolkit", "session", "new", "s.toml", "--ask", "--set", "instrument=rig"]
    done = subprocess.run(
        words, input="2026-02-03\nfirst person\n\n\n\n", capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "operator: a text" in done.stderr
    text = (folder / "s.toml").read_text()
    assert "date = 2026-02-03\n" in text
    assert '\noperator = "first person"\n' in text
    assert "\n#data = " in text


def test_a_name_that_nobody_knows_has_no_role_of_its_unit_alone(folder: Path) -> None:
    (folder / "r.csv").write_text(
        "Radlast [kN];A [N];Schräglauf [rad];G1 [mV/V];Temp [degC];F_Y [N]\n1;2;0,1;1;20;5\n"
    )
    _, told = commands.answer("machine", "new", "m.toml", "--from", "r.csv")
    roles = {column["symbol"]: column.get("role") for column in told["guessed"]["column"]}
    assert {name: roles[name] for name in ("Radlast", "A", "Schräglauf", "G1", "Temp")} == {
        "Radlast": None, "A": None, "Schräglauf": None, "G1": "indication", "Temp": "covariate",
    }  # fmt: skip
    assert {"column[1].role", "column[2].role", "column[3].role"} <= {*told["open"]}
    silent = "\n".join(told["not_guessed"])
    assert "Radlast [kN]: what it holds" in silent
    assert "no column is known as the load" in silent
    assert "no column is known as the slip angle" in silent
    assert (folder / "m.toml").read_text().count('#role = "..."   # FILL IN') == len(
        [name for name in told["open"] if name.startswith("column")]
    )


def test_what_process_and_the_report_ask_for_is_marked_in_a_new_test(folder: Path) -> None:
    """Values of test.toml that the default template prints outside a tk:if, by the template itself."""
    from docx import Document

    from toolkit.report.word.scan import scan
    from toolkit.report.word.xml import stories

    template = Path(__file__).parents[2] / "report_templates" / "org.docx"
    paths = {
        site.tag.path
        for site in scan(stories(Document(str(template)).part.package))
        if site.tag.family == "value"
        and not any("tk:if." in str(tag.get(tag.keys()[0])) for parent in site.element.iterancestors()
                    for tag in parent.iterfind("{*}sdtPr/{*}tag"))
    }  # fmt: skip
    entries = {"pressure", "operator", "requestor", "special", "surface", "laboratory", "date"}
    printed = {path.removeprefix("test.") for path in paths} & entries
    printed |= {path for path in paths if path.startswith("tire.")}
    assert {"date", "requestor", "tire.company", "tire.DOT", "tire.series"} <= printed
    asked = asked_of(form_of("test"), {})
    assert printed == asked.keys()
    assert commands.said("test", "new", "test.toml", "--no-ask").code == 0
    text = filled_in((folder / "test.toml").read_text())
    (folder / "test.toml").write_text(text)
    assert asked_of(form_of("test"), tomllib.loads(text)) == {}
    assert read(form_of("test"), folder / "test.toml")


READERS = {"session": read_session, "machine": lambda path: load_machine(str(path)), "plan": read_plan}


@pytest.mark.parametrize("word", READERS)
def test_every_entry_is_accepted_as_it_is_printed_by_the_reader_of_its_command(
    word: str, folder: Path
) -> None:
    rows = (f"{1 + i // 10},up,{i % 10 / 10},{i % 10 * 100 + (-1) ** i / 10}" for i in range(40))
    (folder / "loads.csv").write_text("run,direction,D51 [mV/V],FY [N]\n" + "\n".join(rows))
    (folder / "...").write_text("D51 [mV/V],FY [N]\n0.5,500\n")  # what the entry check is printed with
    shutil.copy(packaged_home() / "toolkit/examples/virtual/tire.tir", "tire.tir")
    assert commands.said(word, "new", "new.toml", "--no-ask").code == 0
    lines = Lines(without_sign((folder / "new.toml").read_text()))
    refused = []
    for block in lines.blocks:
        for at in block.entries:
            if "standard.xml" in lines.lines[at]:
                continue  # a digital certificate, which nobody has here
            (folder / "taken.toml").write_text(lines.taken(block, at))
            try:
                READERS[word](folder / "taken.toml")
            except ToolkitError as error:
                refused.append((block.table, lines.lines[at], str(error)))
    assert refused == []


@pytest.mark.parametrize(
    "words",
    [
        ["--from", "../loads.csv"],
        ["--set", "data=../loads.csv"],
        ["--from", "loads.csv", "--set", "check=../loads.csv"],
        ["--from", "link.csv"],
        ["--from", "loads.csv", "--set", "reference.dcc=../loads.csv"],
    ],
)
def test_a_session_is_not_begun_with_data_that_calibrate_does_not_read(
    folder: Path, words: list[str]
) -> None:
    (folder / "loads.csv").write_text(LOADS)
    (folder / "below").mkdir()
    (folder / "below" / "loads.csv").write_text(LOADS)
    (folder / "below" / "link.csv").symlink_to(folder / "loads.csv")
    os.chdir(folder / "below")
    code, answer = commands.answer("session", "new", "SESSION.toml", *words)
    assert (code, answer["error"]["rule"]) == (2, "outside")
    assert not (folder / "below" / "SESSION.toml").exists()


def computed_belt(folder: Path) -> None:
    """Write the recording of a belt that computes its forces itself, with a channel of no tire model."""
    rows = [
        f"{number / 100},{angle},{load},{-0.9 * load * math.tanh(angle / 4):.2f},{load * angle / 1e3},45.2"
        for load in (2000, 4000)
        for number, angle in enumerate([angle / 4 for angle in range(-32, 33)])
    ]
    header = "time [s],SA [deg],FZ [N],FY [N],MZ [N*m],TST [degC]"
    (folder / "run_01.csv").write_text("\n".join([header, *rows]) + "\n")


def test_a_belt_that_computes_its_forces_is_led_to_a_fit_and_not_to_an_approval(folder: Path) -> None:
    computed_belt(folder)
    code, told = commands.answer("machine", "new", "belt.toml", "--from", "run_01.csv", *sets(BELT))
    assert (code, told["open"]) == (0, [])
    assert any("--machine" in text and "indication" in text for text in told["not_guessed"])
    assert commands.answer("init", ".")[0] == 0
    assert (
        commands.answer("test", "new", "test.toml", "--set", "machine=belt.toml", "--set", "date=2026-03-17")[
            0
        ]
        == 0
    )
    for words in (["process", "."], ["process", ".", "--draft"], ["fit", "."]):
        code, answer = commands.answer(*words)
        assert (code, answer["error"]["rule"]) == (2, "no-indications"), answer
        assert "toolkit fit FILE --machine" in answer["error"]["next_step"]


def test_a_recording_of_a_machine_is_fitted_by_its_definition(folder: Path) -> None:
    computed_belt(folder)
    assert commands.answer("machine", "new", "belt.toml", "--from", "run_01.csv", *sets(BELT))[0] == 0
    code, answer = commands.answer("fit", "run_01.csv")
    assert (code, answer["error"]["rule"]) == (2, "unknown-column")
    assert "--machine" in answer["error"]["next_step"]
    code, answer = commands.answer("fit", "run_01.csv", "--machine", "belt.toml")
    assert code in (0, 1), answer
    table = (folder / "run_01.csv").read_text().splitlines()
    (folder / "table.csv").write_text("\n".join(line.rpartition(",")[0] for line in table) + "\n")
    code, same = commands.answer("fit", "table.csv", "--axes", "ISO-W")
    assert [row["parameters"] for row in answer["fits"]] == [row["parameters"] for row in same["fits"]]
    code, answer = commands.answer("fit", "run_01.csv", "--machine", "belt.toml", "--axes", "SAE")
    assert (code, answer["error"]["rule"]) == (2, "usage")


def test_a_recording_of_no_known_machine_is_led_to_a_definition(folder: Path) -> None:
    computed_belt(folder)
    code, answer = commands.answer("inspect", "run_01.csv")
    assert (code, answer["error"]["rule"]) == (2, "missing-column")
    assert "toolkit machine new" in answer["error"]["next_step"]
