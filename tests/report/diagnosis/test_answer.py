"""A diagnosis in a test's report: the tags of its own document, an opinion apart, and nothing without it."""

from __future__ import annotations

import dataclasses
import datetime as dt
from pathlib import Path

import pytest

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import FOLDER, grey_png, opened, p, texts
from toolkit.diagnosis.answer.answer import (
    ChannelMismatch,
    DiagnosedEffect,
    Diagnosis,
    EffectEstimate,
    EffectEvidence,
    HeldOutChannel,
    HeldOutFit,
    MismatchPlace,
    RejectedEffect,
)
from toolkit.findings import Finding
from toolkit.report.content import ReportContent
from toolkit.report.diagnosis.answer import DIAGNOSIS, Told
from toolkit.report.figures import Picture, _figure
from toolkit.report.kinds import VOCABULARIES, list_tags
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style
from toolkit.report.test.content import REPORT, build_content
from toolkit.report.word.check import vocabulary_of
from toolkit.report.word.fill import Filled, fill
from toolkit.report.word.package import open_package, read_template
from toolkit.report.word.scan import scan
from toolkit.report.word.xml import stories

EFFECT = DiagnosedEffect(
    name="quadratic_drag", channel="F", stage="dynamics", statement="Drag is missing.",
    equation="F = - drag v|v|", reference="Newton", equivalent_to=("viscous_damping",),
    rejected=(RejectedEffect(name="coulomb_friction", log_likelihood_less=12.0),),
    evidence=EffectEvidence(held_out_log_score_gain=106.5, p_value=1e-12),
    parameters=(EffectEstimate(name="drag", value=808.0, unit="N", ci95=(780.0, 835.0), runs=None),),
)  # fmt: skip
ANSWER = Diagnosis(
    title="A carriage", case_sha256="ab" * 32, verdict="equivalent", remaining="nothing", effects=(EFFECT,),
    mismatch=(
        ChannelMismatch(channel="F", p_value=1e-9, share_of_variance=0.9, where=(
            MismatchPlace(variable="v", start=0.5, end=1.5, unit="m/s", runs=("r0",)),
        )),
    ),
    nominal_parameters=(), depends_on=(), not_found=(), findings=(), complete=True,
    skipped=(), fit=HeldOutFit(held_out_by="run", held_out=(HeldOutChannel(
        channel="F", unit="N", nominal_rmse=30.0, refitted_rmse=9.0, augmented_rmse=2.0, noise_floor=2.0,
    ),)),
    next_measurements=("a run at twice the speed",),
)  # fmt: skip


def content(told: Told | None) -> ReportContent:
    return build_content(make_result(), make_record(), issued=dt.date(2026, 11, 21), diagnosis=told)


def made(name: str, told: Told | None, folder: Path) -> Filled:
    found = content(told)
    picture = Picture(png=grey_png(63, 37), width_px=63, height_px=37)
    return fill(
        read_template(FOLDER / f"{name}.docx"), found, dict.fromkeys(found.plots, picture), allow_missing=True
    )


@pytest.mark.parametrize(
    ("name", "opinion"), [("org", "Opinion, not a result"), ("pruefbericht", "Meinung, kein Prüfergebnis")]
)
def test_the_chapter_is_there_with_a_diagnosis_alone(name: str, opinion: str, tmp_path: Path) -> None:
    said = made(name, Told(answer=ANSWER, by="second person"), tmp_path)
    tags = {one.tag: one.text for one in said.manifest}
    text = " ".join(texts(said.docx).split())
    assert "A class of effects" in tags["tk:diagnosis.verdict"]
    assert "F from 9 to 2 N" in tags["tk:diagnosis.summary"]
    assert "0.5 to 1.5 m/s" in tags["tk:diagnosis.where"]
    assert tags["tk:table.found.equation"] == "F = - drag v|v|"
    assert tags["tk:table.found_parameters.interval"] == "780 to 835"
    assert tags["tk:table.next.measure"] == "a run at twice the speed"
    assert tags["tk:diagnosis.remains"].startswith("Nothing")
    assert tags["tk:diagnosis.case"] == f"SHA-256 {'ab' * 32}"
    assert "tk:figure.diagnosis_errors" in dict(said.figures)
    # The cause stands behind the words that mark it as an opinion, with who released it.
    at = text.index(opinion)
    assert at < text.index("quadratic_drag on F, or viscous_damping: Drag is missing.", at)
    assert "released by second person" in text
    assert "quadratic_drag" not in text[:at]
    without = made(name, None, tmp_path)
    assert not [one for one in without.manifest if "diagnosis" in one.tag]
    assert opinion not in texts(without.docx)
    assert len(without.figures) == len(said.figures) - 1


def test_a_diagnosis_that_found_nothing_has_no_opinion(tmp_path: Path) -> None:
    nothing = dataclasses.replace(
        ANSWER,
        verdict="nothing",
        effects=(),
        mismatch=(),
        next_measurements=(),
        fit=dataclasses.replace(ANSWER.fit, held_out=()),
    )
    said = made("org", Told(answer=nothing), tmp_path)
    tags = {one.tag for one in said.manifest}
    assert "tk:diagnosis.verdict" in tags
    assert not tags & {"tk:diagnosis.opinion", "tk:diagnosis.opinion_by", "tk:diagnosis.basis"}
    assert not [one for one in tags if one.startswith(("tk:table.found", "tk:table.next"))]
    assert "tk:figure.diagnosis_errors" not in dict(said.figures)


@pytest.mark.parametrize(
    ("name", "caption"),
    [("org", "Findings of the diagnosis."), ("pruefbericht", "Feststellungen der Diagnose.")],
)
def test_the_findings_of_the_answer_are_a_table_of_the_chapter(
    name: str, caption: str, tmp_path: Path
) -> None:
    rests = Finding(rule="case-calibration", where="case.toml", message="rests on m15-r2, a candidate")
    told = dataclasses.replace(ANSWER, findings=(rests,))
    said = made(name, Told(answer=told), tmp_path)
    tags = {one.tag: one.text for one in said.manifest}
    for column in ("rule", "where", "message"):
        assert tags[f"tk:table.diagnosis_findings.{column}"] == getattr(rests, column)
    assert caption in " ".join(texts(said.docx).split())
    # A template without the table says it too.
    assert "Rests on m15-r2, a candidate." in tags["tk:diagnosis.summary"]
    without = made(name, Told(answer=ANSWER), tmp_path)
    assert caption not in " ".join(texts(without.docx).split())


def test_without_a_name_the_opinion_is_a_draft(tmp_path: Path) -> None:
    said = made("org", Told(answer=ANSWER), tmp_path)
    assert "nobody authorised" in {one.tag: one.text for one in said.manifest}["tk:diagnosis.opinion_by"]


def test_the_tags_are_those_of_the_diagnosis_own_document() -> None:
    report, own = REPORT.vocabulary, DIAGNOSIS.vocabulary
    values = {entry.path: entry for entry in report.values if entry.path.startswith("diagnosis.")}
    assert all(own.value(path) == entry for path, entry in values.items())
    # What only the case and the search have is in the diagnosis' own document alone.
    assert {entry.path for entry in own.values} - set(values) == {
        "signature",
        *(f"diagnosis.{name}" for name in ("calibrations", "model", "issued", "software")),
    }
    shared = set(own.tables) - {"recorded"}
    assert all(report.tables[name] == own.tables[name] for name in shared)
    assert set(report.figures) & set(own.figures) == {"diagnosis_errors"}
    available = {one["tag"]: one["available"] for one in list_tags(content(None), Style(), report)}
    assert not [tag for tag, there in available.items() if "diagnosis" in tag and there]
    assert not available["tk:table.found"]


def test_the_legend_of_the_chart_ends_inside_the_picture() -> None:
    plot = content(Told(answer=ANSWER)).plots["diagnosis_errors"]
    figure = _figure(plot)
    figure.canvas.draw()
    assert figure.legends[0].get_window_extent().x1 <= figure.bbox.x1


def test_a_report_that_tells_a_diagnosis_is_still_a_report(tmp_path: Path) -> None:
    def kind(body: str, *, hash_: bool) -> object:
        sites = scan(stories(open_package(opened(tmp_path, body, hash_=hash_))))
        return vocabulary_of(sites, VOCABULARIES)

    assert kind(p("{{tk:diagnosis.verdict}}"), hash_=True) is REPORT.vocabulary
    assert kind(p("{{tk:diagnosis.id}} {{tk:diagnosis.case}}"), hash_=False) is DIAGNOSIS.vocabulary
    assert check_template(opened(tmp_path, p("{{tk:diagnosis.verdict}}")), Style()) == ()
    wrong = check_template(opened(tmp_path, p("{{tk:diagnosis.model}}")), Style())
    assert [one.rule for one in wrong] == ["unknown-tag"]


def test_a_range_of_the_output_itself_is_one_of_the_simulated_output(tmp_path: Path) -> None:
    """A limit is missing: the simulation goes to 22 650 kW, where the recording ends at 3 600."""
    place = MismatchPlace(variable="F", start=8558.0, end=22650.0, unit="N", runs=("r0",))
    answer = dataclasses.replace(ANSWER, mismatch=(dataclasses.replace(ANSWER.mismatch[0], where=(place,)),))
    tags = {each.tag: each.text for each in made("org", Told(answer=answer), tmp_path).manifest}
    assert "most of it where the simulated F is" in tags["tk:diagnosis.where"]
