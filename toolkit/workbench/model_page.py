"""The model of an answer: its effects are switched and sized by hand while the simulation answers."""

from __future__ import annotations

import re
import threading
from typing import TYPE_CHECKING

from starlette.exceptions import HTTPException
from starlette.responses import RedirectResponse

from toolkit.lab.holdings import ANSWER
from toolkit.lab.seen_diagnosis import read_diagnosis
from toolkit.lab.sized_model import MODELS, keep_model, sizable_model, sized_from, trial_answer
from toolkit.workbench.page import page

if TYPE_CHECKING:
    from pathlib import Path

    from starlette.requests import Request
    from starlette.responses import Response

    from toolkit.lab.sized_model import SizableModel
    from toolkit.workbench.bench import Bench
    from toolkit.workbench.page import Routes

_KEPT = re.compile(r"model-[1-9][0-9]{0,8}/model\.toml")
_ANSWERING = threading.Lock()  # one simulation at a time: a hand on a size asks again and again


def model(request: Request) -> Response:
    """Return the page: the effects with their sizes, and a place for what the simulation says."""
    bench, folder, sizable = _asked(request)
    kept = request.query_params.get("kept", "")
    is_kept = _KEPT.fullmatch(kept) and (bench.home / MODELS / kept).is_file()
    return page(
        request, "model", diagnosis_id=request.path_params["diagnosis"], effects=sizable.effects,
        answer=read_diagnosis(folder).answer, kept=f"{MODELS}/{kept}" if is_kept else None,
    )  # fmt: skip


def attempt(request: Request) -> Response:
    """Return what the simulation says with the effects as they are set."""
    bench, _, sizable = _asked(request)
    sized = sized_from(sizable.model, request.state.form)
    with _ANSWERING:
        answer = trial_answer(sizable, sized, bench.home)
    return page(request, "part_trial", answer=answer)


def keep(request: Request) -> Response:
    """Keep the effects as they are set as a model file of the home."""
    bench, _, sizable = _asked(request)
    place_of = keep_model(bench.home, sizable.model, sized_from(sizable.model, request.state.form))
    kept = place_of.removeprefix(f"{MODELS}/")
    address = f"{bench.keys.place}/diagnosis/{request.path_params['diagnosis']}/model"
    return RedirectResponse(f"{address}?kept={kept}", 303)


def _asked(request: Request) -> tuple[Bench, Path, SizableModel]:
    bench: Bench = request.app.state.bench
    folder = bench.path_of("diagnosis", request.path_params["diagnosis"])
    if folder is None or not (folder / ANSWER).is_file():
        raise HTTPException(404)
    sizable = sizable_model(folder, bench.holdings())
    if sizable is None:
        raise HTTPException(404)
    return bench, folder, sizable


ROUTES: Routes = (
    ("GET", "/diagnosis/{diagnosis}/model", model),
    ("POST", "/diagnosis/{diagnosis}/model/try", attempt),
    ("POST", "/diagnosis/{diagnosis}/model/keep", keep),
)
