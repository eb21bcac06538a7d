"""The server of a page: fixed files for everybody on this machine, answers for those who have its token."""

import asyncio
import contextlib
import functools
import hmac
import html
import json
import secrets
import socket
import tempfile
import threading
import webbrowser
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, cast
from urllib.parse import parse_qsl, urlencode

import plotly
import uvicorn
from pydantic import BaseModel, Field, ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.types import Receive, Scope, Send

from sim.explorer import take
from sim.explorer.drawing import contact
from sim.explorer.job import Say, command, ensemble, fitted
from sim.explorer.page import Page, Refused as BadValues
from sim.scenario.scenario import Scenario
from sim.units.errors import BadInput

#: Bytes that a request may have, a table of 2 MB in it escaped; jobs at once.
_MOST_BYTES, _MOST_JOBS = 4_200_000, 2
_RUN = "/run"
#: Words of an address that are none of a slider, and most words of an address.
_VIEW, _MOST_FIELDS = ("share", "absolute", "first", "loads"), 200
#: Type of each file of the page, by its address.
_FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/explore.js": ("explore.js", "text/javascript; charset=utf-8"),
    "/explore.css": ("explore.css", "text/css; charset=utf-8"),
    "/plotly.css": ("plotly.css", "text/css; charset=utf-8"),
}
_PLOTLY = "/plotly.js"
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; connect-src 'self';"
    " img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; require-trusted-types-for 'script';"
    " frame-ancestors "
)
_NOTEBOOKS = "http://localhost:* http://127.0.0.1:*"


class Refused(Exception):
    """A request that is not answered: its status, and the reason in words."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Asked(BaseModel, extra="forbid", allow_inf_nan=False, strict=True):
    """A request for an answer: values of sliders [SI], or as text with units, and what else the answer needs."""

    values: Annotated[dict[str, float | str], Field(max_length=100)] = {}
    share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    loads: bool = False
    data: str | None = None
    text: str = ""
    name: Annotated[str, Field(max_length=300)] = ""
    speed: Annotated[float, Field(gt=0.0, lt=1e6)] = 1.0
    kind: Literal["png", "svg", "pdf"] = "png"
    task: Literal["ensemble", "fit"] = "ensemble"
    members: Annotated[int, Field(ge=1, le=100_000)] = 1
    free: Annotated[list[str], Field(max_length=20)] = []


class Guarded:
    """The application: it answers requests of this page alone.

    A request must name this server as its host. A request for an answer must also hold the token of the page, come from
    the page itself and be JSON.
    """

    def __init__(self, page: Page, port: int, framed: bool = False) -> None:
        self.token = secrets.token_urlsafe(32)
        self._page, self._lock = page, threading.Lock()
        self._hosts = {f"{name}:{port}".encode() for name in ("127.0.0.1", "localhost")}
        static = files("sim.explorer").joinpath("static")
        self._files = {at: (static.joinpath(name).read_bytes(), kind) for at, (name, kind) in _FILES.items()}
        script = Path(plotly.__file__).with_name("package_data") / "plotly.min.js"
        self._files[_PLOTLY] = script.read_bytes(), "text/javascript; charset=utf-8"
        self._headers = {
            "content-security-policy": _POLICY + (_NOTEBOOKS if framed else "'none'"),
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin",
            "cache-control": "no-store",
        }
        self._answers: dict[str, Callable[[Asked], Any]] = {
            "/start": lambda asked: page.start(),
            "/curves": lambda asked: page.answer(asked.values, asked.share, asked.loads, asked.data),
            "/words": lambda asked: page.words(asked.values),
            "/band": lambda asked: page.band(asked.values),
            "/contact": lambda asked: contact(page.read(asked.values), asked.speed),
            "/data": lambda asked: {"data": page.add(asked.text, asked.name)},
            "/toml": lambda asked: {"text": page.toml(asked.values)},
            "/csv": lambda asked: {"text": take.table(page.read(asked.values), page.speeds)},
            "/picture": lambda asked: take.picture(page.read(asked.values), page.speeds, asked.kind),
        }
        self._running, self._jobs = 0, set[Process]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request of the protocol ASGI."""
        if scope["type"] != "http":
            return
        status, kind = 200, "application/json"
        try:
            headers = self._checked(scope)
            if scope["method"] == "GET" and scope["path"] in self._files:
                body, kind = self._files[scope["path"]]
            else:
                self._check_answerable(scope, headers)
                asked = Asked.model_validate_json(await _body(headers, receive))
                if scope["path"] == _RUN:
                    await self._stream(await run_in_threadpool(self._task, asked), receive, send)
                    return
                answer = await run_in_threadpool(self._answer, scope["path"], asked)
                kind = kind if isinstance(answer, dict) else take.PICTURES[asked.kind]
                body = json.dumps(answer).encode() if isinstance(answer, dict) else answer
        except Refused as fault:
            status, body = fault.status, json.dumps({"message": str(fault)}).encode()
        except ValidationError:
            status, body = 400, json.dumps({"message": "no request of this page"}).encode()
        except BadValues as fault:
            body = json.dumps({"faults": fault.faults}).encode()
        except BadInput as fault:
            status, body = 422, json.dumps({"message": "; ".join(fault.problems)}).encode()
        await self._begin(status, kind, send, len(body))
        await send({"type": "http.response.body", "body": body})

    async def _begin(self, status: int, kind: str, send: Send, length: int | None = None) -> None:
        """Send the status and the headers of an answer."""
        of_answer = {"content-type": kind} | ({} if length is None else {"content-length": str(length)})
        lines = [(name.encode(), value.encode()) for name, value in (self._headers | of_answer).items()]
        await send({"type": "http.response.start", "status": status, "headers": lines})

    def _task(self, asked: Asked) -> Callable[[Say], dict[str, Any]]:
        """Return the task of a job that is asked for."""
        if asked.task == "ensemble":
            return functools.partial(ensemble, self._page.scenes(asked.values, asked.members))
        if (table := self._page.tables.get(asked.data)) is None or not asked.free:
            raise Refused(400, "a fit needs a table and numbers that are free")
        return functools.partial(fitted, self._page.read(asked.values), table, asked.free)

    async def _stream(self, task: Callable[[Say], dict[str, Any]], receive: Receive, send: Send) -> None:
        """Run a task in a process of its own for as long as its reader stays, and send its messages as lines."""
        if self._running >= _MOST_JOBS:
            raise Refused(429, f"{_MOST_JOBS} computations are under way; stop one of them")
        self._running += 1
        words, given = command(task)
        try:
            job = await asyncio.create_subprocess_exec(*words, stdin=PIPE, stdout=PIPE)
            writing, reading = cast(asyncio.StreamWriter, job.stdin), cast(asyncio.StreamReader, job.stdout)
            self._jobs.add(job)
            gone = asyncio.ensure_future(_until_gone(receive))
            gone.add_done_callback(lambda _: self._end(job))
            try:
                writing.write(given)
                await self._begin(200, "application/x-ndjson", send)
                async for line in reading:
                    await send({"type": "http.response.body", "body": line, "more_body": True})
                self._jobs.discard(job)  # it ends by itself, or was ended
                await send({"type": "http.response.body", "body": b""})
            finally:
                gone.cancel()
                self._end(job)
                await job.wait()
        finally:
            self._running -= 1

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
        if len(headers) != len(scope["headers"]) or headers.get(b"host") not in self._hosts:
            raise Refused(403, "another host")
        if headers.get(b"sec-fetch-site", b"none") not in (b"none", b"same-origin") and not (
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
            raise Refused(403, "This page has lost its key. Open the address that sim explore printed.")
        if headers.get(b"origin", b"http://" + headers[b"host"]) != b"http://" + headers[b"host"]:
            raise Refused(403, "another origin")
        if headers.get(b"content-type") != b"application/json":
            raise Refused(403, "no JSON")

    def _answer(self, path: str, asked: Asked) -> Any:
        with self._lock:  # the caches of the laws and matplotlib are not made for several threads
            return self._answers[path](asked)


async def _body(headers: dict[bytes, bytes], receive: Receive) -> bytes:
    """Return the body of a request, which is read whole."""
    announced, read = headers.get(b"content-length", b"0"), bytearray()
    while announced.isdigit() and int(announced) <= _MOST_BYTES and len(read) <= _MOST_BYTES:
        message = await receive()
        read += message.get("body", b"")
        if not message.get("more_body"):  # also if the reader is gone
            return bytes(read)
    raise Refused(413, "too large")


async def _until_gone(receive: Receive) -> None:
    """Return once the reader of an answer is gone."""
    while (await receive())["type"] != "http.disconnect":
        pass


def bound(port: int) -> socket.socket:
    """Return a socket of this machine alone, at a port or, for 0, at one that is free.

    Raises
    ------
    BadInput
        If the port is in use.
    """
    result = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)  # the number makes answers at once
    exclusive = getattr(socket, "SO_EXCLUSIVEADDRUSE", None)
    result.setsockopt(socket.SOL_SOCKET, exclusive or socket.SO_REUSEADDR, 1)
    try:
        result.bind(("127.0.0.1", port))
        result.listen(128)
    except OSError:
        result.close()
        raise BadInput([f"--port {port}: the port is in use; name another one, or none for one that is free"]) from None
    return result


@contextlib.contextmanager
def _opener(address: str) -> Iterator[str]:
    """Return the address of a file, for this user alone, that leads a browser to an address which holds a token.

    A browser that is opened with the address itself would show the token in the list of processes.
    """
    with tempfile.TemporaryDirectory(prefix="sim-explore-") as folder:
        path = Path(folder) / "open.html"
        path.touch(mode=0o600)
        path.write_text(
            f'<!doctype html><meta http-equiv="refresh" content="0;url={html.escape(address)}">', encoding="utf-8"
        )
        yield path.as_uri()


def state_of(link: str, page: Page) -> str:
    """Return the numbers of a link to a page as the fragment of another address.

    Raises
    ------
    BadInput
        If the link has anything but numbers of this page.
    """
    words = dict(parse_qsl(link.rpartition("#")[2], keep_blank_values=True, max_num_fields=_MOST_FIELDS))
    words.pop("token", None)
    try:
        numbers = {key: float(word) for key, word in words.items()}
        page.read({key: number for key, number in numbers.items() if key not in _VIEW})
    except ValueError as fault:
        raise BadInput(
            [f"--state: cannot be used ({fault}); copy the whole address of a page of this scenario"]
        ) from None
    return urlencode(words)


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
        self, scenario: Scenario, port: int = 0, data: Path | None = None, state: str = "", framed: bool = False
    ) -> None:
        page = Page(scenario, data)
        numbers = state_of(state, page)
        self._socket = bound(port)
        self.port = self._socket.getsockname()[1]
        application = Guarded(page, self.port, framed)
        self.address = f"http://127.0.0.1:{self.port}/#token={application.token}" + f"&{numbers}" * bool(numbers)
        options: Any = {"proxy_headers": False, "server_header": False, "ws": "none", "access_log": False}
        options |= {"log_level": "error", "lifespan": "off", "timeout_graceful_shutdown": 1}
        self._server = _Stopping(uvicorn.Config(application, **options))

    def run(self) -> None:
        """Serve until the process is interrupted."""
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
        there = f"from another machine: ssh -L {self.port}:127.0.0.1:{self.port} HOST"
        return f"a page to explore at {self.address}; {there}; close() ends it"


def serve(server: Server, browser: bool, say: Callable[[str], None]) -> None:
    """Serve a page until the process is stopped, and open a browser; ``say`` takes the lines that are printed."""
    say(f"open {server.address}")
    say(f"Ctrl-C stops it; from another machine, first: ssh -L {server.port}:127.0.0.1:{server.port} HOST")
    with _opener(server.address) as link:
        if browser and not webbrowser.open(link):
            say("no browser was found: open the address above")
        server.run()
