"""The disk cache: a store that is missing, broken, read-only or full costs time, never a run."""

from pathlib import Path
from unittest.mock import Mock

from sim.numerics import disk_cache


def test_a_result_is_cached_for_each_key_and_only_if_it_took_long(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path))
    computed = []
    for key in ("a", "a", "b"):
        disk_cache.cached(key, lambda key=key: computed.append(key))
    assert computed == ["a", "a", "b"]
    monkeypatch.setattr(disk_cache, "_WORTH", -1.0)
    for key in ("a", "a", "b", "a"):
        assert (
            disk_cache.cached(key, lambda key=key: computed.append(key) or f"of {key}")
            == f"of {key}"
        )
    assert computed[3:] == ["a", "b"]
    for path in tmp_path.rglob("found/*"):
        path.write_bytes(path.read_bytes()[:-1])
    assert disk_cache.cached("a", lambda: "anew") == "anew"
    monkeypatch.setattr(disk_cache, "digest", lambda: b"of other sources")
    assert disk_cache.cached("a", lambda: "of others") == "of others"
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path / "file"))
    assert disk_cache.cached("a", lambda: "in no folder") == "in no folder"
    monkeypatch.delenv("SIM_CACHE_DIR")
    monkeypatch.setattr(Path, "expanduser", Mock(side_effect=RuntimeError("no home")))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert disk_cache.cached("a", lambda: "without a home") == "without a home"
