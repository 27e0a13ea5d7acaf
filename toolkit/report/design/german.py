"""A second organisation's template: German, with a letterhead, styles of its own and a landscape section."""

# ruff: noqa: E501  lines of a template's text read best whole
from __future__ import annotations

from typing import Any

from toolkit.report.design.blocks import Pieces, cell, field, paragraph, row, run, table
from toolkit.report.design.default import build_document
from toolkit.report.design.diagnosis import GERMAN, diagnosis_section
from toolkit.report.design.opening import heading
from toolkit.report.design.pieces import across, contents, logo, logo_png, one_rule, section_break
from toolkit.report.design.styles import make_styles
from toolkit.report.template.xml import q

_GREEN, _GREY = "2E5E4E", "4A4A4A"
_UPRIGHT = (30.0, 20.0, 22.0, 25.0)
_ACROSS = (25.0, 20.0, 20.0, 20.0)
_NAMES = {
    "Heading1": "berschrift1", "Caption": "Beschriftung", "TOCHeading": "Inhaltsverzeichnisberschrift",
    "TOC1": "Verzeichnis1", "TOC2": "Verzeichnis2", "TableText": "Tabellentext", "TableHead": "Tabellenkopf",
    "Header": "Kopfzeile", "Footer": "Fuzeile", "Normal": "Standard", "Title": "Titel", "Notice": "Hinweis",
    "Signature": "Unterschrift", "Figure": "Abbildung", "Fact": "Angabe", "FactLabel": "Angabenname", "Gap": "Abstand",
    "EndMark": "Berichtsende", "Small": "Kleingedrucktes",
}  # fmt: skip

STYLE_FILE = """\
# Formatdatei zu pruefbericht.docx.
schema = 1
decimal_comma = true
dates = "%d.%m.%Y"
missing = "k. A."
required = ["tk:calibration.hash", "tk:report.id", "tk:report.method"]

[laboratory]
name = "Reifenprüfstelle Musterstadt"
address = "Prüfweg 1, 01234 Musterstadt"
contact = "pruefstelle@example.org"
place = "Halle 2, Musterstadt"

[report]
method = "Kraft- und Momentenmessung auf der Außentrommel, angelehnt an SAE J1987 (die Trommel ist kein Flachbahnprüfstand)"

[styles]
heading = "heading 1"
caption = "Caption"

[decimals]
N = 0
"N*m" = 1
"N/deg" = 0
"N*m/deg" = 1
deg = 2
FZ = 0
load = 0

[words]
"slip angle" = "Schräglaufwinkel"
"lateral force" = "Seitenkraft"
"aligning moment" = "Rückstellmoment"
"load" = "Radlast"
"conicity" = "Konizität"
"plysteer" = "Plysteer"
"cornering stiffness" = "Schräglaufsteifigkeit"
"aligning stiffness" = "Rückstellsteifigkeit"
"±1 deg secant" = "Sekante ±1 deg"
"slope at 0 deg" = "Steigung bei 0 deg"
"at 0 deg" = "bei 0 deg"
"at FY = 0" = "bei FY = 0"
"forward and reverse" = "vorwärts und rückwärts"
"the tire turned round on the hub" = "Reifen auf der Nabe gewendet"
"forward" = "vorwärts"
"reverse" = "rückwärts"
"simulated data" = "simulierte Daten"
"measured data" = "gemessene Daten"
"SIMULATED DATA" = "SIMULIERTE DATEN"
"verified" = "nachgerechnet"
"none" = "keine"
"findings" = "Feststellungen"
"finding" = "Feststellung"
"listed under Findings" = "siehe Anlage"
"Tire force and moment test" = "Reifenprüfung, Kräfte und Momente"
"conicity residual aligning torque" = "Konizitäts-Restrückstellmoment"
"plysteer residual aligning torque" = "Plysteer-Restrückstellmoment"

[alt]                                 # weitere Wörter für die Alternativtexte der Abbildungen
"Lateral force" = "Seitenkraft"
"Aligning moment" = "Rückstellmoment"
"Conicity" = "Konizität"
"Plysteer" = "Plysteer"
"Conicity residual aligning torque" = "Konizitäts-Restrückstellmoment"
"Plysteer residual aligning torque" = "Plysteer-Restrückstellmoment"
"Cornering stiffness" = "Schräglaufsteifigkeit"
"Aligning stiffness" = "Rückstellsteifigkeit"
"Gough plot" = "Gough-Diagramm"
"Residuals of" = "Abweichungen von"
"against" = "über"
"at" = "bei"
"loads" = "Radlasten"
"at constant slip angles of plus and minus" = "bei konstanten Schräglaufwinkeln von plus und minus"
"with lines of constant load" = "mit Linien konstanter Radlast"
"and of constant slip angle" = "und konstanten Schräglaufwinkels"
"with expanded uncertainty" = "mit erweiterter Messunsicherheit"
"measured and by" = "gemessen und mit"
"from" = "von"
"to" = "bis"
"Axis system" = "Achsensystem"
"""


def build_german() -> bytes:
    """Return the template as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Prüfbericht",
        body=lambda p: [_german(one) for one in _body(p)],
        header=lambda p: _german(_header(p)),
        footer=lambda p: _german(_footer(p)),
        styles=_styles,
        margins_mm=_UPRIGHT,
        letterhead=(logo_png(_GREEN), lambda p, rel: _german(_letterhead(p, rel))),
    )


def _german(fragment: str) -> str:
    """Return a fragment with the ids that a German Word gives its styles."""
    for name, own in _NAMES.items():
        for kind in ("pStyle", "rStyle"):
            fragment = fragment.replace(f'<w:{kind} w:val="{name}"/>', f'<w:{kind} w:val="{own}"/>')
    return fragment.replace("1F3A5F", _GREEN).replace("EEF2F6", "EDF3EF")


def _styles(document: Any) -> None:
    from docx.shared import RGBColor

    make_styles(document)
    for style in document.styles.element.iter(q("w:style")):
        identity = style.get(q("w:styleId"))
        if identity in _NAMES:
            style.set(q("w:styleId"), _NAMES[identity])
        for tag in ("basedOn", "next", "link"):
            for one in style.iter(q(f"w:{tag}")):
                one.set(q("w:val"), _NAMES.get(one.get(q("w:val")), one.get(q("w:val"))))
        for fonts in style.iter(q("w:rFonts")):
            for side in ("ascii", "hAnsi", "cs"):
                if fonts.get(q(f"w:{side}")) == "Calibri":
                    fonts.set(q(f"w:{side}"), "Arial")
        for size in style.iter(q("w:sz"), q("w:szCs")):
            size.set(q("w:val"), str(max(15, round(int(size.get(q("w:val"))) * 0.9))))
    ink = RGBColor.from_string(_GREEN)
    for style in document.styles:
        if style.style_id in ("berschrift1", "Titel", "Inhaltsverzeichnisberschrift", "Angabenname"):
            style.font.color.rgb = ink
    for language in document.styles.element.iter(q("w:lang")):
        language.set(q("w:val"), "de-DE")


def _body(p: Pieces) -> list[str]:
    force, moment = "{{tk:unit.force}}", "{{tk:unit.moment}}"
    wide = (42.0, 123.0)

    def figure(name: str, caption: str) -> str:
        return p.figure(name, 140, kind="Abbildung", caption=caption)

    return [
        paragraph(run("Prüfbericht"), style="Title").replace("</w:pPr>", '<w:jc w:val="left"/></w:pPr>', 1),
        p.block(
            "tk:if.simulated",
            paragraph(
                run("SIMULIERTE DATEN: am virtuellen Prüfstand entstanden, keine Messung an einem Reifen."),
                style="Notice",
            ),
        ),
        p.block(
            "tk:if.unverified",
            paragraph(run("KALIBRIERUNG NICHT NACHGERECHNET (Altbestand)."), style="Notice"),
        ),
        p.facts(
            [
                [("Berichtsnummer", "report.id")],
                [("Ersetzt?", "report.amends")],
                [("Grund?", "report.amendment")],
                [("Auftraggeber?", "report.customer")],
                [("Anschrift?", "report.customer_contact")],
                [("Prüfgegenstand?", "item.description")],
                [("Zustand?", "item.condition")],
                [("Eingang?", "item.received")],
                [("Prüfdatum", "test.date")],
                [("Prüfort?", "report.location")],
                [("Verfahren", "report.method")],
                [("Abweichungen", "report.deviations")],
                [("Probenahme?", "report.sampling")],
                [("Konformität?", "report.conformity")],
                [("Fremdleistungen?", "report.external")],
                [("Prüfer?", "test.operator")],
                [("Ausgestellt am", "report.date")],
            ],
            wide,
        ),
        paragraph("", style="Gap"),
        contents("Inhalt"),
        paragraph(
            run(
                "Die Ergebnisse beziehen sich nur auf den geprüften Gegenstand im Zustand bei Anlieferung. Der Bericht darf nur "
                "vollständig vervielfältigt werden. Erweiterte Unsicherheiten haben eine Überdeckungswahrscheinlichkeit von etwa 95 %."
            ),
            style="Small",
        ),
        heading("Prüfbedingungen").replace("</w:pPr>", "<w:pageBreakBefore/></w:pPr>", 1),
        p.facts(
            [
                [("Prüfstand", "test.machine")],
                [("Lauffläche?", "test.surface")],
                [("Luftdruck?", "test.pressure")],
                [("Radlasten", "test.loads")],
                [("Schräglaufwinkel?", "test.slip_angles")],
                [("Drehrichtungen", "test.directions")],
                [("Kalibrierung", "calibration.id")],
                [("SHA-256", "calibration.hash")],
                [("Achsensystem", "test.axes")],
            ],
            wide,
        ),
        heading("Kennlinien"),
        figure(
            "fy_vs_slip",
            "Seitenkraft über dem Schräglaufwinkel bei allen Radlasten; gefüllt: vorwärts, offen: rückwärts.",
        ),
        figure("mz_vs_slip", "Rückstellmoment über dem Schräglaufwinkel bei allen Radlasten."),
        figure("gough", "Gough-Diagramm: Seitenkraft über dem Rückstellmoment."),
        p.block(
            "tk:if.pull",
            heading("Geradeauslauf")
            + figure("conicity", "Konizität über der Radlast mit erweiterter Unsicherheit.")
            + figure("plysteer", "Plysteer über der Radlast mit erweiterter Unsicherheit.")
            + p.table(
                "pull",
                "Kenngrößen des Geradeauslaufs mit erweiterten Unsicherheiten.",
                [
                    f"Radlast [{force}]",
                    f"Konizität [{force}]",
                    f"Plysteer [{force}]",
                    f"CRAT [{moment}]",
                    f"PRAT [{moment}]",
                ],
                ["load", "conicity ± U_conicity", "plysteer ± U_plysteer", "CRAT ± U_CRAT", "PRAT ± U_PRAT"],
                [25, 35, 35, 35, 35],
                "rrrrr",
                kind="Tabelle",
            ),
        ),
        section_break(landscape=False, margins_mm=_UPRIGHT),
        heading("Messwerte"),
        p.table(
            "results",
            "Mittelwerte der Lastblöcke, wie gemessen; U: erweiterte Messunsicherheit aus allen Quellen (k = 2).",
            [
                "Drehrichtung",
                "SA [deg]",
                f"FZ [{force}]",
                f"FY [{force}]",
                f"U [{force}]",
                f"MZ [{moment}]",
                f"U [{moment}]",
                "Messdatei",
            ],
            ["rotation", "SA", "FZ", "FY", "U_FY", "MZ", "U_MZ", "file"],
            [34, 28, 30, 32, 26, 32, 26, 49],
            "lrrrrrrl",
            kind="Tabelle",
        ),
        p.table(
            "files",
            "Messdateien und ihre SHA-256-Prüfsummen.",
            ["Messdatei", "Drehrichtung", "SHA-256"],
            ["file", "rotation", "sha256"],
            [60, 40, 157],
            "lll",
            kind="Tabelle",
        ),
        section_break(landscape=True, margins_mm=_ACROSS),
        heading("Feststellungen"),
        p.block("tk:if.no_findings", paragraph(run("Es gibt keine Feststellungen."))),
        p.table(
            "findings",
            "Feststellungen des Auswerteprogramms (im Wortlaut, englisch).",
            ["Regel", "Ort", "Feststellung"],
            ["rule", "where", "message"],
            [34, 40, 91],
            "lll",
            kind="Tabelle",
        ),
        diagnosis_section(p, GERMAN, width_mm=165),
        p.block(
            "tk:if.opinions",
            heading("Meinungen und Interpretationen")
            + paragraph(
                run(
                    "Das Folgende sind Meinungen und Interpretationen (ISO/IEC 17025, 7.8.7), keine Prüfergebnisse."
                )
            )
            + p.table(
                "opinions",
                "Meinungen und Interpretationen und ihre Grundlage.",
                ["Meinung oder Interpretation", "Grundlage"],
                ["statement", "basis"],
                [95, 70],
                "ll",
                kind="Tabelle",
            ),
        ),
        p.block(
            "tk:if.report.authorised_by",
            paragraph(
                run("Freigegeben: ")
                + p.inline("tk:report.authorised_by", "Name")
                + p.block(
                    "tk:if.report.authorised_function",
                    run(", ") + p.inline("tk:report.authorised_function", "Funktion"),
                ),
                style="Signature",
                keep=True,
            ),
        ),
        paragraph(
            run("Ende des Prüfberichts ") + p.inline("tk:report.id", "Berichtsnummer"), style="EndMark"
        ),
    ]


def _letterhead(p: Pieces, rel: str) -> str:
    address = (
        paragraph(p.inline("tk:laboratory.name", "Prüfstelle"), style="Header")
        + paragraph(p.inline("tk:laboratory.address", "Anschrift"), style="Header")
        + paragraph(p.inline("tk:laboratory.contact", "Kontakt"), style="Header")
    )
    right = cell(run("x"), 135, style="Header", align="r")
    start, end = right.index("<w:p>"), right.rindex("</w:tc>")
    stacked = (
        right[:start]
        + address.replace('w:val="Header"/>', 'w:val="Header"/><w:jc w:val="right"/>')
        + right[end:]
    )
    mark = cell(logo(rel, 17, number=900, text="Zeichen der Prüfstelle"), 30, style="Header")
    return one_rule(table(row(mark + stacked), (30, 135), rules="none")) + paragraph("", style="Gap")


def _header(p: Pieces) -> str:
    sides = cell(p.inline("tk:laboratory.name", "Prüfstelle"), 82, style="Header") + cell(
        run("Prüfbericht ") + p.inline("tk:report.id", "Berichtsnummer"), 83, style="Header", align="r"
    )
    return across(sides, (82, 83))


def _footer(p: Pieces) -> str:
    sides = cell(p.inline("tk:test.name", "Prüfung"), 82, style="Footer") + cell(
        run("Seite ") + field("PAGE") + run(" von ") + field("NUMPAGES"), 83, style="Footer", align="r"
    )
    return across(sides, (82, 83))
