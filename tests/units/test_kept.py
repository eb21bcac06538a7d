"""The disk cache: a store that is missing, broken, read-only or full costs time, never a run."""

from sim.units import kept


def test_a_file_is_read_only_as_it_was_stored(tmp_path):
    path = tmp_path / "new" / "file"
    assert kept.read(path) is None
    kept.store(path, b"content")
    assert kept.read(path) == b"content"
    assert [entry.name for entry in path.parent.iterdir()] == ["file"]
    path.write_bytes(path.read_bytes().replace(b"content", b"kontent"))
    assert kept.read(path) is None


def test_a_result_is_cached_for_each_key_and_only_if_it_took_long(tmp_path, monkeypatch):
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path))
    computed = []
    for key in ("a", "a", "b"):
        kept.found(key, lambda key=key: computed.append(key))
    assert computed == ["a", "a", "b"]
    monkeypatch.setattr(kept, "_WORTH", -1.0)
    for key in ("a", "a", "b", "a"):
        assert kept.found(key, lambda key=key: computed.append(key) or f"of {key}") == f"of {key}"
    assert computed[3:] == ["a", "b"]
    for path in tmp_path.rglob("found/*"):
        path.write_bytes(path.read_bytes()[:-1])
    assert kept.found("a", lambda: "anew") == "anew"
    monkeypatch.setattr(kept, "digest", lambda: b"of other sources")
    assert kept.found("a", lambda: "of others") == "of others"
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path / "file"))
    assert kept.found("a", lambda: "in no folder") == "in no folder"
