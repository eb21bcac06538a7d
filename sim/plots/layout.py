"""Places of panels, legends and labels: nothing leaves a figure, and no legend hides a curve."""

import re
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend
from matplotlib.offsetbox import VPacker
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

#: A word, or mathematics with the letters beside it: no line breaks within.
_WORD = re.compile(r"(?:\$[^$]*\$|[^\s$])+")

#: Height of a panel that has room for no more than two numbers of its axis [in].
_LOW = 0.4

#: The letter of a panel, which is left out of a figure with less than 0.6 in for each.
_LETTER = re.compile(r"\([a-z]\)")

#: Largest letters of legends that are tried in turn [pt], the smallest of all texts, and
#: the share of the height of a figure that legends may take if smaller letters help.
_LETTERS, _LEAST, _MOST = (99.0, 6.0, 5.0, 4.0), 4.0, 0.35


class Layout(ConstrainedLayoutEngine):
    """A constrained layout that fits legends, labels and titles into their room.

    Legends stand above panels. Each gets as many columns as are not wider than the figure.
    Long texts are broken, and letters are smaller if texts take too much room.
    """

    def __init__(self) -> None:
        super().__init__()
        # each text as it is shown, as a whole, and with its letters
        self._texts: dict[Text, tuple[str, str, float]] = {}

    def execute(self, fig: Figure) -> None:
        """Place the panels twice, because their places change the room of texts."""
        for _ in range(2):
            self._fit(fig)
            super().execute(fig)

    def _fit(self, figure: Figure) -> None:
        """Fit all texts into the figure as it is."""
        frame, panels = figure.bbox, figure.findobj(Axes)
        rooms = dict.fromkeys(figure.legends, frame.width)
        is_high = frame.height > 0.6 * figure.dpi * len(panels)
        for panel in panels:
            box = panel.get_window_extent()
            locator = panel.yaxis.get_major_locator()
            if isinstance(locator, MaxNLocator):
                is_low = box.height < _LOW * figure.dpi
                locator.set_params(min_n_ticks=2 if is_low else 3)
            self._wrap(panel.title, box.width)
            for text in panel.texts:
                if _LETTER.fullmatch(text.get_text()):
                    text.set_visible(is_high)
            self._wrap(panel.xaxis.label, 1.1 * box.width)
            self._wrap(panel.yaxis.label, 1.1 * box.height)
            if legend := panel.get_legend():
                is_last = box.x1 > 0.6 * frame.x1
                rooms[legend] = (frame.x1 if is_last else box.x1) - box.x0
        for text in figure.texts:
            self._wrap(text, 0.95 * frame.width)
        for letters in _LETTERS:
            heights = [
                room / frame.width * self._legend(legend, letters, 0.97 * room)
                for legend, room in rooms.items()
            ]
            if sum(heights) < _MOST * frame.height:
                break

    def _legend(self, legend: Legend, letters: float, room: float) -> float:
        """Give a legend the largest number of columns that is not wider than its room [px]; return its height."""
        self._wrap(legend.get_title(), 0.95 * room, letters)
        for columns in (4, 3, 2, 1):
            for text in legend.get_texts():
                self._wrap(text, 0.85 * room if columns == 1 else np.inf, letters)
            _arrange(legend, columns)
            box = legend.get_window_extent()
            if box.width <= room:
                break
        return float(box.height)

    def _wrap(self, text: Text, room: float, letters: float = 99.0) -> None:
        """Break a text into lines that are not longer than the room [px], with smaller letters if a word is."""
        shown, whole, size = self._texts.get(text, ("", "", float(text.get_fontsize())))
        if text.get_text() != shown:
            whole = text.get_text()
        text.set_fontsize(min(size, letters))
        for length in range(max(len(whole), 8), 7, -3):
            text.set_text(broken(whole, length))
            box = text.get_window_extent()
            if (excess := max(box.width, box.height) / room) <= 1.0:
                break
        else:
            text.set_fontsize(max(min(size, letters) / excess, _LEAST))
        self._texts[text] = text.get_text(), whole, size


def _arrange(legend: Legend, columns: int) -> None:
    """Distribute the entries of a legend over columns; matplotlib does so only once."""
    whole: Any = legend.get_children()[0]
    stacks = whole.get_children()[1].get_children()
    if not stacks:  # a title alone
        return
    first = stacks[0]
    entries = [entry for stack in stacks for entry in stack.get_children()]
    places = np.array_split(np.arange(len(entries)), columns)
    stacks[:] = [
        VPacker(
            first.pad,
            first.sep,
            align=first.align,
            mode=first.mode,
            children=[entries[place] for place in some],
        )
        for some in filter(len, places)
    ]
    for stack in stacks:
        stack.set_figure(legend.get_figure())


def broken(text: str, length: int) -> str:
    r"""Return a text in lines of at most a length, broken between words.

    >>> broken(r"the law $A_0 - \alpha Q^2$ of incipient shear", 27)
    'the law $A_0 - \\alpha Q^2$\nof incipient shear'
    """
    lines = []
    for part in text.split("\n"):
        line = ""
        for word in _WORD.findall(part):
            if line and len(line) + len(word) >= length:
                lines.append(line)
                line = ""
            line = f"{line} {word}".lstrip()
        lines.append(line)
    return "\n".join(lines)
