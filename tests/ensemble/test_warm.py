"""All kernels and laws are compiled at once, and what is there already stays."""

import ast

import pytest
from click.testing import CliRunner

from sim.cli import cli
from sim.ensemble import warm
from sim.numerics import jit

SOME = ["sim.laws.jkr.pull_off_load", "sim.laws.jkr.radius_at_load", "sim.numerics.special.lambert_w"]


@pytest.fixture
def cold(tmp_path, monkeypatch):
    """An empty cache, into which compilation in other processes goes."""
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path))
    jit._cache_folder.cache_clear()
    yield tmp_path
    jit._cache_folder.cache_clear()


def test_every_kernel_and_law_of_the_sources_is_compiled(cold):
    decorated = set()
    for module, text in jit.sources().items():
        for node in ast.parse(text).body:
            for mark in getattr(node, "decorator_list", ()):
                if getattr(mark, "id", getattr(getattr(mark, "func", None), "id", "")) in ("kernel", "law"):
                    decorated.add(f"{module}.{node.name}")
    assert set(warm.missing()) == decorated
    assert len(decorated) > 50


def test_kernels_are_compiled_in_other_processes_once(cold, monkeypatch):
    missing = warm.missing()
    monkeypatch.setattr(warm, "missing", lambda: [name for name in SOME if not jit.cached(name)])
    done = CliRunner().invoke(cli, ["warm", "--jobs", "2"])
    assert done.exit_code == 0
    assert done.stdout.startswith(f"3 of {len(jit.compiled)} kernels and laws compiled")
    monkeypatch.undo()
    monkeypatch.setenv("SIM_CACHE_DIR", str(cold))
    assert set(missing) - set(warm.missing()) == set(SOME)
    before = {path: path.stat().st_mtime_ns for path in cold.rglob("*") if path.is_file()}
    warm.compile_all(SOME, 1, (done := []).append)
    assert done == [1, 1, 1]
    assert {path: path.stat().st_mtime_ns for path in cold.rglob("*") if path.is_file()} == before


def test_a_cache_that_cannot_be_written_is_no_success(cold, monkeypatch):
    (cold / "sliding-sim").write_text("no folder", encoding="utf-8")
    monkeypatch.setattr(warm, "missing", lambda: SOME[:1])
    done = CliRunner().invoke(cli, ["warm"])
    assert done.exception.exit_code == 74
    assert "SIM_CACHE_DIR" in str(done.exception)
