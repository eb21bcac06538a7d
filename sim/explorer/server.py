"""The server of a page: fixed files for everybody on this machine, answers for those who have its token."""

import asyncio
import contextlib
import functools
import hmac
import html
import importlib
import secrets
import socket
import tempfile
import threading
import webbrowser
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, cast
from urllib.parse import parse_qsl, urlencode

import uvicorn
from pydantic import BaseModel, Field, ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException as Refused
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.types import Receive, Scope, Send

from sim.explorer.connection import Connection
from sim.explorer.figures import contact_to_scale
from sim.explorer.page import Page, Refused as BadValues, stamp_of
from sim.scenario.scenario import Scenario
from sim.units.errors import BadInput

#: Bytes that a request may have, a table of 2 MB in it escaped; jobs at once.
_MOST_BYTES, _MOST_JOBS = 4_200_000, 2
_RUN = "/run"
#: Addresses whose answers wait for no other ones.
_PROMPT = ("/curves", "/motion", "/others", "/shown")
#: Words of an address that are none of a slider, and most words of an address.
_VIEW, _MOST_FIELDS = ("share", "absolute", "first", "loads", "figure"), 200
#: Figures of a page; types of its files.
_FIGURES = ("motion", "sweep", "speed", "data", "spread", "map")
_TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; connect-src 'self';"
    " img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; require-trusted-types-for 'script';"
    " frame-ancestors "
)
_NOTEBOOKS = "http://localhost:* http://127.0.0.1:*"


class Query(BaseModel, extra="forbid", allow_inf_nan=False, strict=True):
    """A request for an answer: values of sliders [SI], or as text with units, and what else the answer needs."""

    values: Annotated[dict[str, float | str], Field(max_length=100)] = {}
    share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    loads: bool = False
    figure: Literal["speed", "sweep", "motion", "data", "spread", "map"] = "speed"
    run: Annotated[str, Field(max_length=32)] = ""
    step: Annotated[int, Field(ge=0)] = 0
    data: str | None = None
    text: str = ""
    name: Annotated[str, Field(max_length=300)] = ""
    speed: Annotated[float, Field(gt=0.0, lt=1e6)] = 1.0
    task: Literal["ensemble", "fit", "plan"] = "ensemble"
    members: Annotated[int, Field(ge=1, le=100_000)] = 1
    free: Annotated[list[str], Field(max_length=20)] = []


class Guarded:
    """The application: it answers requests of this page alone.

    A request must name this server as its host. A request for an answer must also hold the token of the page, come from
    the page itself and be JSON.
    """

    def __init__(self, page: Page, port: int, framed: bool = False) -> None:
        self.token = secrets.token_urlsafe(32)
        self._refused = ""  # stamp of a file that could not be read
        self._page, self._locks = (
            page,
            {path: threading.Lock() for path in (*_PROMPT, "")},
        )
        self._hosts = {f"{name}:{port}".encode() for name in ("127.0.0.1", "localhost")}
        static = Path(__file__).with_name("static").iterdir()
        self._files = {
            f"/{path.name}": path for path in static if path.suffix[1:] in _TYPES
        }
        self._files["/"] = self._files.pop("/page.html")
        self._headers = {
            "content-security-policy": _POLICY + (_NOTEBOOKS if framed else "'none'"),
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin",
            "cache-control": "no-store",
        }
        self._answers: dict[str, Callable[[Query], Any]] = {
            "/start": lambda query: self._page.start(),
            "/curves": lambda query: self._page.answer(
                query.values, query.share, query.figure, query.data
            ),
            "/others": lambda query: self._page.others(
                query.values, query.figure, query.loads
            ),
            "/shown": lambda query: self._page.figure(
                query.values, query.figure, query.data
            ),
            "/motion": lambda query: self._page.motions.advance(
                self._page.read(query.values), query.run, query.step
            ),
            "/words": lambda query: self._page.words(query.values),
            "/band": lambda query: self._page.band(query.values),
            "/contact": lambda query: contact_to_scale(
                self._page.read(query.values, built=False), query.speed
            ),
            "/data": lambda query: {"data": self._page.add(query.text, query.name)},
            "/file": lambda query: self._followed(),
            "/difference": lambda query: self._page.difference(query.values),
            "/write": lambda query: self._page.write(query.values, query.text),
            "/toml": lambda query: {"text": self._page.toml(query.values)},
            "/csv": lambda query: {"text": self._page.csv(query.values)},
        }
        self._places, self._jobs = asyncio.Semaphore(_MOST_JOBS), set[Process]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request of the protocol ASGI."""
        try:
            headers = self._checked(scope)
            if scope["method"] == "GET" and (path := self._files.get(scope["path"])):
                answer = Response(path.read_bytes(), media_type=_TYPES[path.suffix[1:]])
            else:
                self._check_answerable(scope, headers)
                query = Query.model_validate_json(await _body(headers, receive))
                if scope["path"] == _RUN:
                    await self._stream(query, scope, receive, send)
                    return
                content = await run_in_threadpool(self._answer, scope["path"], query)
                answer = JSONResponse(content)
        except Refused as fault:
            answer = JSONResponse({"message": fault.detail}, fault.status_code)
        except ValidationError:
            answer = JSONResponse({"message": "no request of this page"}, 400)
        except BadValues as fault:
            answer = JSONResponse({"faults": fault.faults})
        except BadInput as fault:
            answer = JSONResponse({"message": "; ".join(fault.problems)}, 422)
        answer.headers.update(self._headers)
        await answer(scope, receive, send)

    def _followed(self) -> dict[str, str]:
        """Return the stamp of the scenario's file, whose page takes the place of that of an earlier one."""
        page = self._page
        stamp = stamp_of(Path(page.path))
        if stamp not in ("", page.stamp, self._refused):
            try:
                self._page = page.renewed()
            except BadInput:
                self._refused = stamp
                raise
        return {"stamp": self._page.stamp}

    def _task(self, query: Query) -> tuple[list[str], bytes]:
        """Return the command of the job that is asked for, and what it reads."""
        from sim.explorer.job import command, ensemble, fitted, planned

        if query.task == "ensemble":
            scenes = self._page.scenes(query.values, query.members)
            return command(functools.partial(ensemble, scenes, describes=True))
        scene = self._page.read(query.values)
        needs_values = query.task == "fit"
        known = self._page.tables if needs_values else self._page.sources
        if query.data is None or query.data not in known or not query.free:
            needed = "measured values" if needs_values else "a table"
            raise Refused(400, f"this needs {needed} and numbers that are free")
        if needs_values:
            task, table = fitted, self._page.tables[query.data]
        else:
            task, table = planned, self._page.planned(query.data)
        return command(functools.partial(task, scene, table, query.free))

    async def _stream(
        self, query: Query, scope: Scope, receive: Receive, send: Send
    ) -> None:
        """Run a job in a process of its own for as long as its reader stays, and send its messages as lines."""
        if self._places.locked():
            raise Refused(
                429, f"{_MOST_JOBS} computations are under way; stop one of them"
            )
        async with self._places:
            words, task_bytes = await run_in_threadpool(self._task, query)
            job = await asyncio.create_subprocess_exec(
                *words, stdin=PIPE, stdout=PIPE, limit=_MOST_BYTES
            )
            writing, reading = (
                cast(asyncio.StreamWriter, job.stdin),
                cast(asyncio.StreamReader, job.stdout),
            )
            self._jobs.add(job)
            try:
                writing.write(task_bytes)
                answer = StreamingResponse(
                    reading, headers=self._headers, media_type="application/x-ndjson"
                )
                # without a version of the protocol it listens for a reader that leaves
                await answer({**scope, "asgi": {}}, receive, send)
                if reading.at_eof():  # it ends by itself, or was ended
                    self._jobs.discard(job)
            finally:
                self._end(job)
                await job.wait()

    def stop(self) -> None:
        """End all jobs."""
        for job in [*self._jobs]:
            self._end(job)

    def _end(self, job: Process) -> None:
        """End a job, once: another signal would take its end from the loop that waits for it."""
        if job in self._jobs:
            self._jobs.discard(job)
            with contextlib.suppress(ProcessLookupError):
                job.kill()

    def _checked(self, scope: Scope) -> dict[bytes, bytes]:
        """Return the headers of a request that names this server once and comes from no other site."""
        headers = dict(scope["headers"])
        if (
            len(headers) != len(scope["headers"])
            or headers.get(b"host") not in self._hosts
        ):
            raise Refused(403, "another host")
        if headers.get(b"sec-fetch-site", b"none") not in (
            b"none",
            b"same-origin",
        ) and not (
            scope["path"] == "/" and headers.get(b"sec-fetch-mode") == b"navigate"
        ):
            raise Refused(403, "another site")
        return headers

    def _check_answerable(self, scope: Scope, headers: dict[bytes, bytes]) -> None:
        """Refuse a request without the token, from another page, or of another kind."""
        known = scope["path"] in self._answers or scope["path"] == _RUN
        if scope["method"] != "POST" or not known or scope["query_string"]:
            raise Refused(403, "no such address")
        if not hmac.compare_digest(headers.get(b"x-token", b""), self.token.encode()):
            raise Refused(
                403,
                "This page has lost its key. Open the address that sim explore printed.",
            )
        if (
            headers.get(b"origin", b"http://" + headers[b"host"])
            != b"http://" + headers[b"host"]
        ):
            raise Refused(403, "another origin")
        if headers.get(b"content-type") != b"application/json":
            raise Refused(403, "no JSON")

    def _answer(self, path: str, query: Query) -> Any:
        # the rest take turns, because their first ones import modules
        with self._locks[path if path in self._locks else ""]:
            return self._answers[path](query)


async def _body(headers: dict[bytes, bytes], receive: Receive) -> bytes:
    """Return the body of a request, which is read whole."""
    length, read = headers.get(b"content-length", b"0"), bytearray()
    while length.isdigit() and int(length) <= _MOST_BYTES and len(read) <= _MOST_BYTES:
        message = await receive()
        read += message.get("body", b"")
        if not message.get("more_body"):  # also if the reader is gone
            return bytes(read)
    raise Refused(413, "too large")


def bound(port: int) -> socket.socket:
    """Return a socket of this machine alone, at a port or, for 0, at one that is free.

    Raises
    ------
    BadInput
        If the port is in use.
    """
    try:
        result = socket.create_server(("127.0.0.1", port), backlog=128)
    except OSError:
        raise BadInput(
            [
                f"--port {port}: the port is in use; name another one, or none for one that is free"
            ]
        ) from None
    # of all its connections: answers go at once
    result.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return result


@contextlib.contextmanager
def _opener(address: str) -> Iterator[str]:
    """Return the address of a file, for this user alone, that leads a browser to an address which holds a token.

    A browser that is opened with the address itself would show the token in the list of processes.
    """
    with tempfile.TemporaryDirectory(prefix="sim-explore-") as folder:
        path = Path(folder) / "open.html"
        path.touch(mode=0o600)
        text = f'<!doctype html><meta http-equiv="refresh" content="0;url={html.escape(address)}">'
        path.write_text(text, encoding="utf-8")
        yield path.as_uri()


def state_of(link: str, page: Page) -> str:
    """Return the numbers of a link to a page as the fragment of another address.

    Raises
    ------
    BadInput
        If the link has anything but numbers of this page.
    """
    words = dict(
        parse_qsl(
            link.rpartition("#")[2], keep_blank_values=True, max_num_fields=_MOST_FIELDS
        )
    )
    words.pop("token", None)
    try:
        if words.get("figure", _FIGURES[0]) not in _FIGURES:
            raise ValueError("no figure of a page")
        numbers = {key: float(word) for key, word in words.items() if key != "figure"}
        page.read({key: number for key, number in numbers.items() if key not in _VIEW})
    except ValueError as fault:
        cure = "copy the whole address of a page of this scenario"
        raise BadInput([f"--state: cannot be used ({fault}); {cure}"]) from None
    return urlencode(words)


def _import_answers() -> None:
    """Import the modules that the first answers need, one after the other.

    Imports compile sources, and CPython 3.11 raises a SystemError if several threads convert syntax trees at once.
    """
    for name in ("scipy.optimize", "sim.explorer.job", "sim.study.fit"):
        importlib.import_module(name)


class _Stopping(uvicorn.Server):
    """A server that ends the jobs of its application when it is stopped, so that it need not wait for their readers."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the jobs, then all else."""
        cast(Guarded, self.config.app).stop()
        await super().shutdown(sockets)


class Server:
    """A page that is served, in this thread by ``run`` or in another one by ``begin``.

    Parameters
    ----------
    scenario : Scenario
        What is explored.
    port : int
        Port of this machine; 0 takes one that is free.
    data : Path, optional
        A table of measured curves that the page shows from its start.
    state : str
        Address of a page whose numbers are taken.
    framed : bool
        True if a notebook may show the page in a frame.

    Raises
    ------
    BadInput
        If the port is in use, the table or the address cannot be used, or the contact of the scenario is open.
    """

    def __init__(
        self,
        scenario: Scenario,
        port: int = 0,
        data: Path | None = None,
        state: str = "",
        framed: bool = False,
    ) -> None:
        page = Page(scenario, data)
        numbers = state_of(state, page)
        self._socket = bound(port)
        self.port = self._socket.getsockname()[1]
        application = Guarded(page, self.port, framed)
        self.address = (
            f"http://127.0.0.1:{self.port}/#token={application.token}"
            + f"&{numbers}" * bool(numbers)
        )
        options: Any = {
            "proxy_headers": False,
            "server_header": False,
            "ws": "none",
            "access_log": False,
        }
        options |= {
            "log_level": "error",
            "lifespan": "off",
            "timeout_graceful_shutdown": 1,
            "http": Connection,
        }
        self._server = _Stopping(uvicorn.Config(application, **options))

    def run(self) -> None:
        """Serve until the process is interrupted."""
        # while the browser starts
        threading.Thread(target=_import_answers, daemon=True).start()
        with self._socket, contextlib.suppress(KeyboardInterrupt):
            self._server.run([self._socket])

    def begin(self) -> None:
        """Serve in a thread until ``close``, or until the process ends."""
        threading.Thread(target=self.run, daemon=True).start()

    def close(self) -> None:
        """End what ``begin`` began."""
        self._server.should_exit = True

    def _repr_html_(self) -> str:
        """Return the page in a frame, for notebooks."""
        frame = f'<iframe src="{html.escape(self.address)}" width="100%" height="900" style="border: 0"></iframe>'
        return f"{frame}<p>If the frame stays empty: {html.escape(repr(self))}</p>"

    def __repr__(self) -> str:
        remote = f"from another machine: ssh -L {self.port}:127.0.0.1:{self.port} HOST"
        return f"a page to explore at {self.address}; {remote}; close() ends it"


def serve(server: Server, browser: bool, say: Callable[[str], None]) -> None:
    """Serve a page until the process is stopped, and open a browser; ``say`` takes the lines that are printed."""
    say(f"open {server.address}")
    say(
        f"Ctrl-C stops it; from another machine, first: ssh -L {server.port}:127.0.0.1:{server.port} HOST"
    )
    with _opener(server.address) as link:
        if browser and not webbrowser.open(link):
            say("no browser was found: open the address above")
        server.run()
