"""What a simulation lacks: diagnoses of the home's cases, and an answer's model, sized by hand.

A case executes its code: from here it runs in the isolated worker alone, without network and without writing.
"""

from __future__ import annotations

import re
import threading
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from toolkit.errors import ToolkitError
from toolkit.lab.desk.built_case import is_open, kinds
from toolkit.lab.desk.holdings import ANSWER, CASE, holding_id
from toolkit.lab.desk.jobs import start_job
from toolkit.lab.desk.sized_model import (
    MODELS,
    SizableModel,
    keep_model,
    read_diagnosis,
    sizable_model,
    sized_from,
    trial_answer,
)
from toolkit.lab.desk.uploads import hand_in_case
from toolkit.workbench.bench import Bench, holding
from toolkit.workbench.page import Routes, page

DIAGNOSES = "diagnoses"
"""Folder of the home into which jobs write."""

_KEPT = re.compile(r"model-[1-9][0-9]{0,8}/model\.toml")
_ANSWERING = threading.Lock()  # one simulation at a time: a hand on a size asks again and again


def diagnoses(request: Request) -> Response:
    """Return the list's page: nothing is looked through before it stands."""
    return diagnoses_page(request)


def diagnoses_page(request: Request, *, status: int = 200, refused: ToolkitError | None = None) -> Response:
    """Return the list's page, with what was refused of a case that somebody handed in or built."""
    bench: Bench = request.app.state.bench
    return page(
        request, "diagnoses", status=status, own=bench.is_own, kinds=kinds(),
        refused=None if refused is None else refused.as_dict(),
    )  # fmt: skip


def take(request: Request) -> Response:
    """Take a case from the browser. It brings code that reads files: only this server's user may."""
    bench: Bench = request.app.state.bench
    if not bench.is_own:
        raise HTTPException(404)
    uploads = [(upload.name, upload.data) for upload in request.state.files.get("files", ())]
    try:
        place_of = hand_in_case(bench.home, uploads)
    except ToolkitError as error:
        return diagnoses_page(request, status=400, refused=error)
    return RedirectResponse(f"{bench.keys.place}/diagnoses#{holding_id(place_of)}", 303)


def diagnosis_list(request: Request) -> Response:
    """Return the answers that the home keeps, and the cases that can be diagnosed."""
    bench: Bench = request.app.state.bench
    holdings = bench.holdings(again=True)
    cases = holdings.places["case"]
    return page(
        request, "part_diagnoses", answers=holdings.places["diagnosis"], cases=cases,
        open={case_id for case_id in cases if bench.is_own and is_open(holdings.home, cases[case_id])},
    )  # fmt: skip


def diagnosis(request: Request) -> Response:
    """Return an answer's page."""
    bench, diagnosis_id, folder = holding(request, "diagnosis")
    return page(
        request, "diagnosis", seen=read_diagnosis(folder), diagnosis_id=diagnosis_id,
        place_of=bench.holdings().places["diagnosis"][diagnosis_id],
    )  # fmt: skip


def start(request: Request) -> Response:
    """Start the diagnosis of a case, isolated."""
    bench, case_id, _ = holding(request, "case")
    place_of = bench.holdings().places["case"][case_id]
    words = (
        "diagnose",
        f"./{place_of}/{CASE}",
        "--out",
        f"{DIAGNOSES}/{place_of}",
        "--isolated",
        "--home",
        ".",
    )
    job = start_job(bench.home, kind="diagnosis", title=place_of, words=words)
    return RedirectResponse(f"{bench.keys.place}/job/{job}", 303)


def model(request: Request) -> Response:
    """Return the page: the effects with their sizes, and a place for what the simulation says."""
    bench, folder, sizable = _requested(request)
    kept = request.query_params.get("kept", "")
    is_kept = _KEPT.fullmatch(kept) and (bench.home / MODELS / kept).is_file()
    return page(
        request, "model", diagnosis_id=request.path_params["diagnosis"], effects=sizable.effects,
        answer=read_diagnosis(folder).answer, kept=f"{MODELS}/{kept}" if is_kept else None,
    )  # fmt: skip


def attempt(request: Request) -> Response:
    """Return what the simulation says with the effects as they are set."""
    bench, _, sizable = _requested(request)
    sized = sized_from(sizable.model, request.state.form)
    with _ANSWERING:
        answer = trial_answer(sizable, sized, bench.home)
    return page(request, "part_trial", answer=answer)


def keep(request: Request) -> Response:
    """Keep the effects as they are set as a model file of the home."""
    bench, _, sizable = _requested(request)
    place_of = keep_model(bench.home, sizable.model, sized_from(sizable.model, request.state.form))
    name = place_of.removeprefix(f"{MODELS}/")
    address = f"{bench.keys.place}/diagnosis/{request.path_params['diagnosis']}/model"
    return RedirectResponse(f"{address}?kept={name}", 303)


def _requested(request: Request) -> tuple[Bench, Path, SizableModel]:
    bench, _, folder = holding(request, "diagnosis")
    sizable = sizable_model(folder, bench.holdings()) if (folder / ANSWER).is_file() else None
    if sizable is None:
        raise HTTPException(404)
    return bench, folder, sizable


ROUTES: Routes = (
    ("GET", "/diagnoses", diagnoses),
    ("POST", "/diagnoses", take),
    ("GET", "/diagnoses/list", diagnosis_list),
    ("GET", "/diagnosis/{diagnosis}", diagnosis),
    ("POST", "/case/{case}/diagnose", start),
    ("GET", "/diagnosis/{diagnosis}/model", model),
    ("POST", "/diagnosis/{diagnosis}/model/try", attempt),
    ("POST", "/diagnosis/{diagnosis}/model/keep", keep),
)
