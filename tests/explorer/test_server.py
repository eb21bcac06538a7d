"""The server of ``sim explore``: who gets an answer, and who does not."""

import contextlib
import functools
import http.client
import json
import logging
import os
import socket
import subprocess
import sys
import threading
import time
import tomllib

import psutil
import pytest
from helpers.commands import LENS
from numpy.testing import assert_allclose

import sim
from sim.explorer.job import command, ensemble
from sim.explorer.server import Server, _opener

SCENE = f"{LENS}[drive]\nspeed = '1 mm/s'\n[bonds]\nmodel = 'steady'\ncritical_speed = '10 mm/s'\nstress = '0.3 MPa'\n"
HUGE = 5_000_000
#: Bonds that are random, so that members differ.
COUNTED = {
    "model": "counted",
    "critical_speed": 1e-2,
    "rebinding_rate": 500.0,
    "sites": 50,
    "stress": 3e5,
}


def _scene():
    return tomllib.loads(SCENE)


@pytest.fixture(scope="module")
def server():
    served = Server(sim.load(_scene()))
    served.begin()
    yield served
    served.close()


@pytest.fixture(scope="module")
def token(server):
    return server.address.partition("token=")[2]


def request(server, method="POST", path="/curves", body=b"{}", headers=(), host=None):
    """Return status and body of a request of these headers alone, beside those of the length and the host."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    with contextlib.closing(connection):
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        if host != "":
            connection.putheader("Host", host or f"127.0.0.1:{server.port}")
        for name, value in headers:
            connection.putheader(name, value)
        if body is not None and not any(
            name in ("Content-Length", "Transfer-Encoding") for name, _ in headers
        ):
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders()
        # of a body that is refused before its end
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            connection.send(body or b"")
        # which holds the socket of a connection that the server ends
        with connection.getresponse() as answer:
            return answer.status, answer.read()


def good(token, **changes):
    """The headers of the page's own requests, some of them changed or, for None, left out."""
    changed = {name.replace("_", "-"): value for name, value in changes.items()}
    headers = {"X-Token": token, "Content-Type": "application/json"} | changed
    return [(name, value) for name, value in headers.items() if value is not None]


def asked(server, token, path="/curves", **table):
    status, body = request(
        server, path=path, body=json.dumps(table).encode(), headers=good(token)
    )
    assert status == 200
    return json.loads(body)


def test_the_page_gets_its_files_and_its_answers(server, token):
    for path, word in (
        ("/", b"<!doctype html>"),
        ("/explore.js", b"import"),
        ("/figure.js", b"export"),
    ):
        status, body = request(server, "GET", path, None)
        assert status == 200 and word in body and token.encode() not in body
    assert asked(server, token, "/start")["title"] == "a scene"
    assert asked(server, token)["level"]["words"].startswith("10 % lost at")
    (remark,) = asked(server, token, "/words")["remarks"]
    # 0.3 MPa over 1 + 1/10 and 1.6 MPa
    assert remark.startswith("the mean stress is 0.17 times the shear modulus")
    assert asked(server, token, "/contact", speed=1e-3)["radius"] > 1e-4
    assert asked(server, token, "/band")["along"] == "speed"
    assert asked(server, token, "/others") == {
        "x": asked(server, token)["x"],
        "others": [],
    }
    assert asked(server, token, "/motion")["first"] == 0
    assert asked(server, token, values={"sphere.radius": "3 kg"})["faults"][
        "sphere.radius"
    ]


OTHER = "http://evil.example"
HEADERS = {
    "no token": {"X_Token": None},
    "wrong token": {"X_Token": "x" * 43},
    "empty token": {"X_Token": ""},
    "letters": {"X_Token": "\u00e9" * 10},
    "text": {"Content_Type": "text/plain"},
    "no type": {"Content_Type": None},
    "form": {"Content_Type": "application/x-www-form-urlencoded"},
    "other origin": {"Origin": OTHER},
    "null origin": {"Origin": "null"},
    "https": {"Origin": "https://127.0.0.1"},
    "no port": {"Origin": "http://127.0.0.1"},
    "other port": {"Origin": "http://127.0.0.1:1"},
    "cross-site": {"Sec_Fetch_Site": "cross-site"},
    "same-site": {"Sec_Fetch_Site": "same-site"},
    "navigation": {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"},
}


@pytest.mark.parametrize("changes", HEADERS.values(), ids=HEADERS)
def test_a_request_that_is_not_the_pages_own_is_refused(server, token, changes):
    status, body = request(
        server, headers=[(n, v.encode("latin-1")) for n, v in good(token, **changes)]
    )
    assert status == 403 and b"a scene" not in body
    assert asked(server, token)["x"]  # the server still answers


@pytest.mark.parametrize("name", ["X-Token", "Content-Type", "Origin", "Host"])
def test_a_doubled_header_is_refused(server, token, name):
    value = {"X-Token": token, "Content-Type": "application/json"}.get(
        name, f"127.0.0.1:{server.port}"
    )
    assert request(server, headers=[*good(token), (name, value), (name, "x")])[0] in (
        400,
        403,
    )


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:{}",
        "127.0.0.1",
        "127.0.0.1:1",
        "[::1]:{}",
        "",
        "0.0.0.0:{}",
    ],
)
def test_another_host_is_refused_as_of_a_name_that_was_bound_anew(server, token, host):
    for method, path in (("GET", "/"), ("POST", "/start")):
        status, body = request(
            server, method, path, b"{}", good(token), host=host.format(server.port)
        )
        assert status in (400, 403) and b"sphere" not in body


@pytest.mark.parametrize(
    "path",
    [
        "/../pyproject.toml",
        "/%2e%2e/server.py",
        "//explore.js",
        "/explore.js/",
        "/server.py",
        "/start/../explore.js",
        "/explore.js%00",
        "/.git/config",
        "/curves?token=x",
        "/\\..\\server.py",
    ],
)
def test_other_paths_have_nothing(server, token, path):
    for method in ("GET", "POST", "PUT", "DELETE", "OPTIONS"):
        assert request(server, method, path, b"{}", good(token))[0] in (400, 403, 405)


REFUSED = {
    "no host": ("", 400),
    "two hosts": ("Host: {host}\r\nHost: x\r\n", 400),
    "no header": ("Host: {host}\r\nno header\r\n", 400),
    "long": ("X: " + "x" * 100_000 + "\r\n", 400),
    "another host, closed": ("Host: x\r\nConnection: close\r\n", 403),
    "no token, closed": ("Host: {host}\r\nConnection: close\r\n", 403),
    "too large, closed": ("Host: {host}\r\n{token}Connection: close\r\n", 413),
}


@pytest.mark.parametrize(("lines", "status"), REFUSED.values(), ids=REFUSED)
def test_a_refusal_is_read_although_its_request_was_not(server, token, lines, status):
    own = "".join(f"{name}: {value}\r\n" for name, value in good(token))
    lines = lines.replace("{host}", f"127.0.0.1:{server.port}").replace("{token}", own)
    head = f"POST /curves HTTP/1.1\r\n{lines}Content-Length: {HUGE}\r\n\r\n"
    with socket.create_connection(("127.0.0.1", server.port), timeout=30) as connection:
        # of which the server reads 256 KiB at once
        connection.sendall(head.encode() + b"x" * HUGE)
        answer = b"".join(iter(functools.partial(connection.recv, 65536), b""))
    assert answer.startswith(f"HTTP/1.1 {status} ".encode())


@pytest.fixture
def log(caplog):
    """The log, with that of the server, which hands nothing on to other loggers."""
    logger = logging.getLogger("uvicorn.error")
    logger.addHandler(caplog.handler)
    yield caplog
    logger.removeHandler(caplog.handler)


@pytest.mark.parametrize("host", ["{host}", "x"])
@pytest.mark.parametrize("wait", [False, True])
def test_a_body_that_is_no_http_ends_in_one_refusal_without_a_trace(
    server, token, host, wait, log
):
    own = "".join(f"{name}: {value}\r\n" for name, value in good(token))
    head = f"POST /curves HTTP/1.1\r\nHost: {host.format(host=f'127.0.0.1:{server.port}')}\r\n{own}"
    with socket.create_connection(("127.0.0.1", server.port), timeout=30) as connection:
        head += "Transfer-Encoding: chunked\r\n\r\n"
        connection.sendall(head.encode() + b"no length\r\n" * (not wait))
        if wait:
            time.sleep(0.2)  # the application has begun, or has refused
            connection.sendall(b"no length\r\n")
        answer = b"".join(iter(functools.partial(connection.recv, 65536), b""))
    assert answer.count(b"HTTP/1.1 4") == 1
    assert asked(server, token)["x"]
    assert not log.records


def test_a_reader_that_stays_after_a_refusal_is_left_after_a_time(server):
    with socket.create_connection(("127.0.0.1", server.port), timeout=30) as connection:
        connection.sendall(b"POST / HTTP/1.1\r\n\r\n")
        assert b"".join(
            iter(functools.partial(connection.recv, 65536), b"")
        ).startswith(b"HTTP/1.1 400 ")

        def is_reset():
            try:
                connection.sendall(b"x")
            except (ConnectionError, OSError):
                return True
            return False

        assert not is_reset()
        assert until(is_reset)


def test_modules_are_imported_in_one_thread_beside_the_server(monkeypatch):
    threads, started = [], threading.Thread.start
    monkeypatch.setattr(
        threading.Thread,
        "start",
        lambda thread: (threads.append(thread), started(thread)),
    )
    server = Server(sim.load(_scene()))
    server.close()  # before it begins: it ends at once
    server.run()
    for thread in threads:
        thread.join(timeout=60)
    assert len(threads) == 1
    assert {"scipy.optimize", "sim.explorer.job"} <= sys.modules.keys()


def test_a_server_that_stops_waits_for_no_reader(log):
    server = Server(sim.load(_scene()))
    thread = threading.Thread(target=server.run)
    thread.start()
    connect = functools.partial(
        socket.create_connection, ("127.0.0.1", server.port), timeout=30
    )
    with connect() as idle, connect() as refused:
        idle.sendall(
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode()
        )
        refused.sendall(b"POST / HTTP/1.1\r\n\r\n")
        assert idle.recv(9) == refused.recv(9) == b"HTTP/1.1 "
        server.close()
        thread.join(timeout=30)
    assert not thread.is_alive()
    assert not log.records


def test_answers_are_not_for_get(server, token):
    for path in ("/start", "/curves", "/run", "/toml"):
        assert request(server, "GET", path, None, good(token))[0] == 403


BODIES = {
    "nan": b'{"values": {"sphere.radius": NaN}}',
    "infinity": b'{"share": Infinity}',
    "1e999": b'{"share": 1e999}',
    "true": b'{"values": {"sphere.radius": true}}',
    "digits": b'{"share": %s}' % (b"9" * 4000),
    "share 2": b'{"share": 2}',
    "many": json.dumps({"values": {str(k): 1.0 for k in range(101)}}).encode(),
    "unknown": b'{"path": "/etc/passwd"}',
    "deep": b"[" * 100_000,
    "utf-8": b"\xff\xfe{}",
    "surrogate": b'{"data": "\\ud800"}',
    "list": b"[]",
    "empty": b"",
    "null": b"null",
    "cut": b'{"values": {',
    "figure": b'{"figure": "../x"}',
    "step": b'{"step": -1}',
    "members": b'{"task": "ensemble", "members": 1e9}',
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_a_malformed_body_is_refused(server, token, body):
    for path in ("/curves", "/motion", "/run", "/data"):
        status, answer = request(server, path=path, body=body, headers=good(token))
        assert status == 400 and json.loads(answer)["message"]
    assert asked(server, token)["x"]


@pytest.mark.parametrize(
    "values",
    [
        {"__class__": 1.0},
        {"constructor": 1.0},
        {"": 1.0},
        {"sphere": 1.0},
        {"a" * 10_000: 1.0},
    ],
)
def test_keys_that_are_no_sliders_are_named(server, token, values):
    assert asked(server, token, values=values)["faults"]


@pytest.mark.parametrize("length", ["1000000000000", str(HUGE), "-1", "x"])
def test_a_body_that_is_announced_too_large_is_refused(server, token, length):
    headers = [*good(token), ("Content-Length", length)]
    assert request(server, body=b"", headers=headers)[0] in (400, 413)


def test_a_body_in_pieces_without_an_end_is_cut(server, token):
    headers = [*good(token), ("Transfer-Encoding", "chunked")]
    piece = b"%x\r\n%s\r\n" % (HUGE, b" " * HUGE)
    assert request(server, body=piece + b"0\r\n\r\n", headers=headers)[0] == 413
    assert asked(server, token)["x"]


def test_all_answers_forbid_other_scripts_frames_and_addresses(server, token):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    with contextlib.closing(connection):
        connection.request("GET", "/")
        with connection.getresponse() as answer:
            policy = answer.getheader("Content-Security-Policy")
    assert (
        "default-src 'none'" in policy
        and "script-src 'self';" in policy
        and "frame-ancestors 'none'" in policy
    )


def test_the_server_is_bound_to_this_machine_alone_and_a_port_is_taken_once(server):
    listening = [
        c.laddr
        for c in psutil.Process().net_connections("tcp")
        if c.laddr.port == server.port and not c.raddr
    ]
    assert {address.ip for address in listening} == {"127.0.0.1"}
    with pytest.raises(sim.BadInput, match="in use"):
        Server(sim.load(_scene()), server.port)


def test_the_browser_is_led_by_a_file_that_only_its_user_reads():
    with _opener("http://127.0.0.1:1/#token=secret") as link:
        path = link.removeprefix("file://")
        assert "secret" not in link
        if os.name == "posix":
            assert os.stat(path).st_mode & 0o077 == 0
    assert not os.path.exists(path)


def begun(server, token, **table):
    """The connection of a job, as soon as another one has left its place."""
    body = json.dumps(table).encode()
    head = (
        f"POST /run HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nX-Token: {token}\r\n"
    )
    head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        with contextlib.ExitStack() as stack:
            connection = stack.enter_context(
                socket.create_connection(("127.0.0.1", server.port), timeout=60)
            )
            connection.sendall(head.encode() + body)
            if connection.recv(100).startswith(b"HTTP/1.1 200"):
                stack.pop_all()
                return connection
    raise AssertionError("no job began")


def workers():
    """The processes of jobs that still run; one that ends while it is looked at does not."""
    running = []
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):  # ZombieProcess is one of these
            if "sim.explorer.job" in " ".join(child.cmdline()):
                running.append(child)
    return running


def until(condition):
    """Return whether something holds within half a minute."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


RAMP = {"drive": {"model": "ramp", "from": 1e-3, "to": 1e-2}, "clock.step": 5e-4}


# of 2001 records every third is drawn, in a line of more than 64 KiB
@pytest.mark.parametrize(
    ("changes", "drawn"), [({}, slice(-1, None)), (RAMP, slice(None, None, 3))]
)
def test_an_ensemble_is_computed_and_its_result_is_that_of_a_run(changes, drawn):
    server = Server(sim.load(_scene(), changes))
    server.begin()
    table = {"task": "ensemble", "members": 3, "values": {}}
    headers = good(server.address.partition("token=")[2])
    status, body = request(
        server, path="/run", body=json.dumps(table).encode(), headers=headers
    )
    *steps, last = (json.loads(line) for line in body.splitlines())
    assert status == 200 and steps[-1] == {"done": 1.0, "left": "1 s"}
    exact = sim.run(sim.load(_scene(), changes)).contact_area[drawn]
    assert_allclose(last["result"]["curves"]["contact_area"]["mean"], exact, rtol=1e-12)
    assert until(lambda: not workers())
    server.close()


def test_a_job_does_not_wait_for_its_input(tmp_path):
    words, content = command(functools.partial(ensemble, [sim.load(_scene())]))
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with process, process.stdin:
        process.stdin.write(content)
        process.stdin.flush()
        # while the input is open, as that of the server's jobs
        printed = process.stdout.read()
    assert "result" in json.loads(printed.splitlines()[-1])
    done = subprocess.run(
        words, input=content, stdout=subprocess.PIPE, timeout=120, check=True
    )
    assert done.stdout.splitlines()[-1] == printed.splitlines()[-1]


#: Begins a job that takes hours, and ends without a word to it.
MORTAL = """
import functools, os, subprocess, tomllib
from helpers.commands import COUNTED, LENS
import sim
from sim.explorer.job import command, ensemble
scene = sim.load(tomllib.loads(LENS + COUNTED), {"clock.duration": "1000 s", "ensemble.members": 100_000})
words, content = command(functools.partial(ensemble, [scene]))
job = subprocess.Popen(words, stdin=subprocess.PIPE)
job.stdin.write(content)
job.stdin.flush()
print(job.pid, flush=True)
os.read(0, 1)
os._exit(1)  # as a process that is killed
"""


def test_a_job_does_not_outlive_the_process_that_began_it():
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(
        [sys.executable, "-c", MORTAL], env=environment, **pipes
    ) as process:
        job = psutil.Process(int(process.stdout.readline()))
        assert job.is_running()
    assert until(lambda: not job.is_running() or job.status() == psutil.STATUS_ZOMBIE)


def test_a_reader_that_leaves_ends_its_job_and_a_third_job_is_refused():
    long = {"task": "ensemble", "members": 100_000, "values": {}}
    server = Server(sim.load(_scene(), {"clock.duration": "1000 s", "bonds": COUNTED}))
    server.begin()
    token = server.address.partition("token=")[2]
    with begun(server, token, **long), begun(server, token, **long):
        status, body = request(
            server, path="/run", body=json.dumps(long).encode(), headers=good(token)
        )
        assert status == 429 and b"stop one" in body
        assert asked(server, token)["x"]
    assert until(lambda: not workers())
    server.close()
