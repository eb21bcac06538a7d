"""The files of the page of ``sim explore``: their size, and nothing that they take from elsewhere."""

import re
from pathlib import Path

import sim.explorer

FILES = [
    path
    for path in Path(sim.explorer.__file__).with_name("static").iterdir()
    if path.suffix in (".html", ".css", ".js")
]


def test_the_page_is_small_and_asks_for_no_foreign_address():
    assert len(FILES) > 5 and sum(path.stat().st_size for path in FILES) < 150_000
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        addresses = set(re.findall(r"https?://[^\"'` )]+", text))
        assert addresses <= {"http://www.w3.org/2000/svg"}, path.name
        assert not re.search(r"innerHTML|document\.write|\beval\(", text), path.name


def test_every_module_that_is_imported_is_served():
    names = {path.name for path in FILES}
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        assert set(re.findall(r'from "\./([^"]+)"', text)) <= names, path.name
