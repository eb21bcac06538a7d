"""What a notebook shows, read from the outputs of a kernel, and the same without one."""

import html
import re
import sys
import tomllib
import types
from pathlib import Path

import pytest
from helpers.commands import LENS, SCENE

import sim
from sim import read
from sim.units import notebook

ROOT = Path(__file__).parents[1]
NOTEBOOK = Path(__file__).with_name("notebook.ipynb")


def run_in_a_kernel(path):
    """The notebook after its run, and the texts of bars in the order in which they were drawn."""
    nbclient, nbformat = (
        pytest.importorskip(name, reason="in the extra verify")
        for name in ("nbclient", "nbformat")
    )

    class Client(nbclient.NotebookClient):
        bars = ()

        def process_message(self, message, cell, index):
            data = message["content"].get("data", {})
            if "<progress" in data.get("text/html", ""):
                self.bars += (data["text/plain"],)
            return super().process_message(message, cell, index)

    notebook = nbformat.read(path, 4)
    folder = {"metadata": {"path": str(path.parent)}}
    client = Client(notebook, timeout=600, kernel_name="python3", resources=folder)
    client.execute()
    return notebook, client.bars


def shown_by(notebook, source, kind):
    """What a cell that begins so shows of a kind of output."""
    (cell,) = (cell for cell in notebook.cells if cell.source.startswith(source))
    (shown,) = (each["data"][kind] for each in cell.outputs if kind in each["data"])
    return shown


@pytest.mark.verify
@pytest.mark.filterwarnings("default")  # those of the kernel's packages
def test_a_notebook_shows_a_bar_that_moves_tables_a_picture_and_a_page():
    executed, bars = run_in_a_kernel(NOTEBOOK)
    shares = [int(text.partition(" %")[0]) for text in bars]
    assert shares[0] == 0 and shares[-1] == 100 and shares == sorted(shares)
    assert len(set(shares)) > 2 and any("left" in text for text in bars)
    bar = shown_by(executed, "dataset = sim.run", "text/html")
    (total, value) = re.search(r'max="(\d+)" value="(\d+)"', bar).groups()
    assert total == value
    cells = {
        "import sim": "<td>contact.load</td><td>4 mN</td>",
        "sim.check": "<p>errors of the result</p><table>",
        "sim.read.tables_of": "<th>A/A_JKR (%)</th>",
        "sim.stats": "<th>contact_radius</th>",
        "sim.report": "&lt;h1&gt;Does the contact",
        "sim.methods": "@article{menga2018",
    }
    for source, part in cells.items():
        assert part in shown_by(executed, source, "text/html"), source
    assert shown_by(executed, "sim.plot", "image/png")


@pytest.mark.verify
@pytest.mark.filterwarnings("default")
def test_the_first_steps_show_a_bar_and_tables_in_a_kernel():
    executed, bars = run_in_a_kernel(ROOT / "docs" / "first_steps.ipynb")
    assert bars[-1].startswith("100 %")
    for source in ("scene = sim.load", "sim.check(scene)"):
        assert "<table>" in shown_by(executed, source, "text/html")


class Kernel(types.ModuleType):
    """A package that displays as IPython does in a kernel, and keeps the pictures."""

    def __init__(self):
        super().__init__("IPython")
        self.kernel, self.pictures, self.display = object(), [], self

    def get_ipython(self):
        return self

    def __call__(self, data, raw, display_id):
        self.pictures.append(data)
        return types.SimpleNamespace(
            update=lambda data, raw: self.pictures.append(data)
        )


def test_a_bar_is_displayed_in_a_kernel_only(monkeypatch, tmp_path, capsys):
    path = tmp_path / "x.toml"
    path.write_text(LENS, encoding="utf-8")
    assert not notebook.is_notebook()
    kernel, display = Kernel(), types.ModuleType("IPython.display")
    display.display = kernel
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    sim.run(path)
    assert kernel.pictures == []
    monkeypatch.setattr(notebook, "_PAUSE", 1e9)  # the end is drawn in any case
    sim.run(path, progress=True)
    texts = [picture["text/plain"] for picture in kernel.pictures]
    assert texts[0].startswith("0 %") and texts[-1].startswith("100 %")
    assert capsys.readouterr() == ("", "")
    del kernel.kernel  # as in a terminal
    assert not notebook.is_notebook()


def test_scenario_check_and_table_are_tables_in_which_markup_is_escaped():
    document = tomllib.loads(SCENE) | {"name": "a <scene>"}
    scene = sim.load(document | {"sweep": {"contact.load": ["1 mN", "2 mN"]}})
    shown = scene._repr_html_()
    assert "<td>contact.load</td><td>2 values</td>" in shown
    assert "<td>sphere.radius</td><td>2 mm</td>" in shown
    assert "<td>a &lt;scene&gt;</td>" in shown and "<scene>" not in shown
    check = sim.check(scene)
    shown = check._repr_html_()
    words = html.unescape(re.sub("</?(?:table|tr|td|p|b)>", " ", shown)).split()
    assert words == check.split() and "<scene>" not in shown
    table = read.tables_of(sim.Run(sim.run(document)))[0]
    cells = re.findall("<td>(.*?)</td>", table._repr_html_())
    printed = [cell for row in table.rows for cell in row.values()]
    assert [*map(html.unescape, cells)] == printed


def test_equal_scenarios_have_one_hash_and_others_another():
    document = tomllib.loads(SCENE) | {"sweep": {"bonds": [{"model": "none"}]}}
    first, again = sim.load(document), sim.load(document)
    assert first == again and len({first, again}) == 1
    assert len({first, sim.load(document, {"contact.load": "3 mN"})}) == 2
