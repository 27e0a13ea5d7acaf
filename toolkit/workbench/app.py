"""The addresses of the workbench, and what answers each."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Mount, Route

from toolkit.errors import ToolkitError
from toolkit.workbench import (
    archive_page,
    assets,
    diagnosis_page,
    home_page,
    jobs_page,
    model_page,
    record_page,
    report_page,
    session_page,
    signing_page,
    tire_test_page,
)
from toolkit.workbench.bench import Bench
from toolkit.workbench.page import is_part, page, refusal

if TYPE_CHECKING:
    from starlette.requests import Request

    from toolkit.calibration.registry.registry import Registry
    from toolkit.trust.people import Person
    from toolkit.workbench.guard import Keys

Page = Callable[["Request"], Response]


def application(home: Path, registry: Registry, keys: Keys, *, person: Person | None = None) -> Starlette:
    """Return the pages of a home below the place of its keys; `guard.Guard` stands before them."""
    routes = [
        Route("/static/{name}", assets.static, name="static"),
        *(Route(path, _answering(handler), methods=methods) for path, handler, methods in _PAGES),
    ]
    app = Starlette(
        routes=[Mount(keys.place, routes=routes)],
        exception_handlers={HTTPException: _no_page},
    )
    app.state.bench = Bench(home, registry, keys, person=person)
    return app


_PAGES: tuple[tuple[str, Page, list[str]], ...] = (
    ("/", home_page.home, ["GET"]),
    ("/agenda/{question}", home_page.agenda, ["GET"]),
    ("/records", record_page.records, ["GET"]),
    ("/record/{record}", record_page.record, ["GET"]),
    ("/record/{record}/part/{part}", record_page.part, ["GET"]),
    ("/record/{record}/decide/{decision}", record_page.decide, ["POST"]),
    ("/tests", tire_test_page.tests, ["GET"]),
    ("/tests/windows", tire_test_page.test_windows, ["GET"]),
    ("/tests/window/{start:int}", tire_test_page.test_window, ["GET"]),
    ("/test/{test}", tire_test_page.test, ["GET"]),
    ("/test/{test}/part/{part}", tire_test_page.part, ["GET"]),
    ("/test/{test}/download/{what}", tire_test_page.download, ["GET"]),
    ("/test/{test}/report", report_page.report, ["GET"]),
    ("/test/{test}/report/part", report_page.part, ["GET"]),
    ("/test/{test}/report/page/{number:int}.png", report_page.picture, ["GET"]),
    ("/test/{test}/report/{step}", report_page.start, ["POST"]),
    ("/templates", report_page.templates, ["GET"]),
    ("/templates", report_page.take, ["POST"]),
    ("/template/{template}/check", report_page.check, ["GET"]),
    ("/beside", tire_test_page.beside, ["GET"]),
    ("/beside/part", tire_test_page.beside_part, ["GET"]),
    ("/audits", archive_page.audits, ["GET"]),
    ("/audits/list", archive_page.audit_list, ["GET"]),
    ("/audit/{audit}", archive_page.audit, ["GET"]),
    ("/audit/{audit}/part/{part}", archive_page.part, ["GET"]),
    ("/audit/{audit}/windows", archive_page.windows, ["GET"]),
    ("/audit/{audit}/window/{start:int}", archive_page.window, ["GET"]),
    ("/audit/{audit}/file/{number:int}", archive_page.file, ["GET"]),
    ("/session", session_page.sessions, ["GET"]),
    ("/session", session_page.begin, ["POST"]),
    ("/session/{draft}", session_page.session, ["GET"]),
    ("/session/{draft}/save", session_page.save, ["POST"]),
    ("/session/{draft}/state", session_page.state, ["POST"]),
    ("/session/{draft}/rehearse", session_page.rehearse, ["POST"]),
    ("/session/{draft}/files", session_page.add_files, ["POST"]),
    ("/session/{draft}/enter", session_page.enter, ["POST"]),
    ("/session/{draft}/discard", session_page.discard, ["POST"]),
    ("/request/{request}", signing_page.request_file, ["GET"]),
    ("/request/{request}/answer", signing_page.answered, ["POST"]),
    ("/request/{request}/sign", signing_page.agent_signed, ["POST"]),
    ("/request/{request}/drop", signing_page.dropped, ["POST"]),
    ("/audit/{audit}/repair", jobs_page.start_repair, ["POST"]),
    ("/diagnoses", diagnosis_page.diagnoses, ["GET"]),
    ("/diagnoses", diagnosis_page.take, ["POST"]),
    ("/diagnoses/list", diagnosis_page.diagnosis_list, ["GET"]),
    ("/diagnosis/{diagnosis}", diagnosis_page.diagnosis, ["GET"]),
    ("/diagnosis/{diagnosis}/model", model_page.model, ["GET"]),
    ("/diagnosis/{diagnosis}/model/try", model_page.attempt, ["POST"]),
    ("/diagnosis/{diagnosis}/model/keep", model_page.keep, ["POST"]),
    ("/case/{case}/diagnose", diagnosis_page.start, ["POST"]),
    ("/jobs", jobs_page.jobs, ["GET"]),
    ("/jobs/audit", jobs_page.start_audit, ["POST"]),
    ("/job/{job}", jobs_page.job, ["GET"]),
    ("/job/{job}/state", jobs_page.state, ["GET"]),
    ("/job/{job}/cancel", jobs_page.cancel, ["POST"]),
)


def _answering(handler: Page) -> Page:
    """Return a page that tells its errors: those on purpose with their next step, a bug as one."""

    def answer(request: Request) -> Response:
        try:
            return handler(request)
        except ToolkitError as error:
            return refusal(request, error)
        except HTTPException:
            raise
        except Exception:  # noqa: BLE001  the last line of defence: a bug, told as one, and the server goes on
            traceback.print_exc()
            return page(request, "part_bug" if is_part(request) else "bug", status=500)

    return answer


def _no_page(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 404
    return page(request, "missing", status=status)
