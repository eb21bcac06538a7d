"""What is kept between runs: a store that is missing, broken, read-only or full costs time, never a run."""

from pathlib import Path

import pytest

import sim
from sim.units import kept, quantity
from sim.units.quantity import Quantity


@pytest.fixture
def anew(tmp_path, monkeypatch):
    """Forget what this process knows of units; what pint is asked goes into a list."""
    asked = []
    find = quantity._found_scale
    monkeypatch.setattr(quantity, "_found_scale", lambda *units: asked.append(units) or find(*units))

    def forget(folder):
        monkeypatch.setenv("SIM_CACHE_DIR", str(folder))
        quantity._known_scales.cache_clear()
        quantity._scale.cache_clear()
        asked.clear()
        return asked

    yield forget
    quantity._known_scales.cache_clear()
    quantity._scale.cache_clear()


def test_a_file_is_read_only_as_it_was_stored(tmp_path):
    path = tmp_path / "new" / "file"
    assert kept.read(path) is None
    kept.store(path, b"content")
    assert kept.read(path) == b"content"
    assert [entry.name for entry in path.parent.iterdir()] == ["file"]
    path.write_bytes(path.read_bytes().replace(b"content", b"kontent"))
    assert kept.read(path) is None


def test_a_unit_is_looked_up_once_and_kept_for_other_processes(anew, tmp_path):
    work = Quantity("J/m^2", "work of adhesion")
    asked = anew(tmp_path)
    first = work.read("42.7 nJ/mm^2")
    assert len(asked) == 1
    asked = anew(tmp_path)
    assert work.read("42.7 nJ/mm^2") == first
    assert not asked
    for fault in ("42 mN/m^2", "42 mJoules/m^2"):  # what is refused is refused by pint each time
        with pytest.raises(ValueError, match="unit"):
            work.read(fault)
    assert len(asked) == 2


def test_a_store_of_units_that_cannot_be_used_changes_no_number(anew, tmp_path, room):
    length = Quantity("m", "length")
    (tmp_path / "file").write_text("no folder")
    asked = anew(tmp_path)
    exact = length.read("3.3 angstrom")
    stored = next(path for path in tmp_path.rglob("units*"))
    stored.write_bytes(b"broken")
    for folder in (tmp_path, tmp_path / "file", "/proc/no-such-place"):
        asked = anew(folder)
        assert length.read("3.3 angstrom") == exact
        assert asked
    with room(10):
        anew(tmp_path / "full")
        assert length.read("3.3 angstrom") == exact
    assert not [path for path in (tmp_path / "full").rglob("*") if path.is_file()]


def test_a_result_is_found_once_for_each_key_and_only_if_it_took_long(tmp_path, monkeypatch):
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path))
    found = []
    for key in ("a", "a", "b"):
        kept.found(key, lambda key=key: found.append(key))
    assert found == ["a", "a", "b"]
    monkeypatch.setattr(kept, "_WORTH", -1.0)
    for key in ("a", "a", "b", "a"):
        assert kept.found(key, lambda key=key: found.append(key) or f"of {key}") == f"of {key}"
    assert found[3:] == ["a", "b"]
    for path in tmp_path.rglob("found/*"):
        path.write_bytes(path.read_bytes()[:-1])
    assert kept.found("a", lambda: "anew") == "anew"
    monkeypatch.setattr(kept, "digest", lambda: b"of other sources")
    assert kept.found("a", lambda: "of others") == "of others"


def test_factors_that_come_with_the_package_are_those_of_pint(anew, tmp_path):
    asked = anew(tmp_path)
    _, common = quantity._known_scales()
    assert len(common) > 50
    for both, scale in common.items():
        assert quantity._found_scale(*both.split(" in ")) == scale
    asked.clear()
    sim.load(Path(sim.__file__).parent / "starter.toml")
    assert not asked
