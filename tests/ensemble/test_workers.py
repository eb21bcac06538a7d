"""Work in a process of its own: what it raises comes back, and a crash ends that process alone."""

import os
import signal
import threading

import pytest

from sim.ensemble import workers
from sim.ensemble.workers import ChildDied, in_process


@pytest.fixture(params=["copy", "new process"])
def either(request, monkeypatch):
    """Work in a copy of this process, or in a new one because another thread runs here."""
    used = []
    for name in ("_in_copy", "_in_new"):
        whole = getattr(workers, name)
        monkeypatch.setattr(workers, name, lambda *work, name=name, whole=whole: used.append(name) or whole(*work))
    if request.param == "copy":
        monkeypatch.setattr(threading, "active_count", lambda: 1)
        yield
        assert set(used) == {"_in_copy"}
    else:
        done = threading.Event()
        waiting = threading.Thread(target=done.wait)
        waiting.start()
        yield
        done.set()
        waiting.join()
        assert set(used) == {"_in_new"}


def test_work_is_done_elsewhere_and_what_it_raises_comes_back(either, tmp_path):
    in_process(os.mkdir, tmp_path / "made")
    assert (tmp_path / "made").is_dir()
    with pytest.raises(FileExistsError):
        in_process(os.mkdir, tmp_path / "made")


def test_a_crash_ends_the_other_process_alone(either):
    with pytest.raises(ChildDied, match="SIGABRT"):
        in_process(os.abort)
    with pytest.raises(ChildDied, match="exit status 3"):
        in_process(os._exit, 3)


def test_an_interrupt_of_the_terminal_does_not_end_it(either):
    in_process(signal.raise_signal, signal.SIGINT)
