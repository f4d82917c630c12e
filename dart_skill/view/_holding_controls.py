"""Controls of a lesson that a person gives with the mouse, and what became of each demonstration."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dart_skill.common import palette

HOW = (
    "Drag the ball at the hand: it moves as the screen does, seen from above over the ground. The"
    " buttons below do the rest. With a keyboard: <b>Shift</b> keeps its height, <b>C</b> closes"
    " and opens the hand, <b>Q</b> and <b>E</b> turn it, <b>V</b> looks from above or from the"
    " side, <b>Enter</b>: done."
)
TURN_BY = 5.0
"""Turn of the hand with one key [degrees]."""
MOST_TURNED = 180.0
"""Largest turn of the hand to either side [degrees]."""


@dataclass(frozen=True)
class DemonstrationRow:
    """What a page tells of one demonstration.

    Parameters
    ----------
    name
        Of it.
    finding
        What can be made of it, or why nothing can.
    seconds
        Of the movement.
    counts
        Whether it is learned from.
    weight
        In the model; nan if nothing is learned yet.
    unlike
        Distance of its way from what the others teach for its situation, root mean square [m]; nan
        if that is not known.
    outlier
        Whether that is far more than of the others.
    """

    name: str
    finding: str
    seconds: float
    counts: bool
    weight: float
    unlike: float
    outlier: bool


class HoldingControls:
    """In a folder of the page, with keys for what hands do while they hold the mouse.

    Parameters
    ----------
    gui
        Of viser.
    ask
        Called in the server's threads with what is asked for and its details: "hold", "grip",
        "turn", "look", "done", "discard", "undo".
    """

    def __init__(self, gui: Any, ask: Callable[[str, dict[str, Any]], None]):
        self._gui, self._ask, self._turned, self._closed, self._above = gui, ask, 0.0, False, False
        with gui.add_folder("Show it yourself"):
            self._take = self._button("Take the hand", lambda: ask("hold", {}))
            self._help = gui.add_html("", visible=False)
            self._where = gui.add_html("", visible=False)
            grip = self._button("Close or open the hand (C)", self._grip)
            self._slider = gui.add_slider(
                "Turn [°]", -MOST_TURNED, MOST_TURNED, 1.0, 0.0, disabled=True
            )
            self._slider.on_update(lambda event: self._slide(event))
            look = self._button("From above, or the side (V)", self._look)
            done = self._button("Done (Enter)", lambda: ask("done", {}))
            discard = self._button("Discard this one", lambda: ask("discard", {}))
            self._undo = self._button("Undo the last one", lambda: ask("undo", {}))
            self._list = gui.add_html("")
        self._while_held = [grip, look, done, discard, self._slider]
        for label, key, act in (
            ("close or open the hand", "C", self._grip),
            ("turn the hand to the left", "Q", lambda: self._turn_by(TURN_BY)),
            ("turn the hand to the right", "E", lambda: self._turn_by(-TURN_BY)),
            ("look from above, or from the side", "V", self._look),
            ("the demonstration is done", "enter", lambda: ask("done", {})),
        ):
            self._add_key(label, key, act)
        self.set_held(False)

    @property
    def take_button(self) -> Any:
        """The one that begins a lesson."""
        return self._take

    def set_held(self, held: bool) -> None:
        """Whether a lesson is under way."""
        self.held, self._closed, self._above = held, False, False
        self._turned = self._slider.value = 0.0
        for control in self._while_held:
            control.disabled = not held
        self._help.visible = self._where.visible = held
        self._help.content, self._where.content = _small(HOW), ""

    def say_where(self, text: str) -> None:
        """How far it is still to go."""
        if self.held:
            self._where.content = _small(html.escape(text))

    def show(self, rows: Sequence[DemonstrationRow]) -> None:
        """What became of each demonstration, the newest last."""
        self._list.content = "".join(_row(number, row) for number, row in enumerate(rows, start=1))

    def _grip(self) -> None:
        if self.held:
            self._closed = not self._closed
            self._ask("grip", {"closes": self._closed})

    def _look(self) -> None:
        if self.held:
            self._above = not self._above
            self._ask("look", {"from_above": self._above})

    def _turn_by(self, degrees: float) -> None:
        if self.held:
            self._turn(self._turned + degrees)
            self._slider.value = self._turned

    def _slide(self, event: Any) -> None:
        if self.held and event.client is not None:  # not by a key
            self._turn(float(event.target.value))

    def _turn(self, degrees: float) -> None:
        if np.isfinite(degrees):
            self._turned = float(np.clip(degrees, -MOST_TURNED, MOST_TURNED))
            self._ask("turn", {"degrees": self._turned})

    def _button(self, label: str, act: Callable[[], None]) -> Any:
        button = self._gui.add_button(label)
        button.on_click(lambda _: act())
        return button

    def _add_key(self, label: str, key: str, act: Callable[[], None]) -> None:
        command = self._gui.add_command(label, hotkey=key)
        command.on_trigger(lambda _: act() if self.held else None)


def _row(number: int, row: DemonstrationRow) -> str:
    colour = palette.VERMILION if row.outlier or not row.counts else palette.GREEN
    said = [f"{row.seconds:.1f} s"]
    if not row.counts:
        said.append("left out")
    elif np.isfinite(row.weight):
        said.append(f"weight {row.weight:.2g}")
    if np.isfinite(row.unlike):
        said.append(
            f"{1e3 * row.unlike:.0f} mm from what the others"
            f" teach{', an outlier' if row.outlier else ''}"
        )
    dot = f"<span style='color:{palette.hexadecimal(colour)}'>&#9679;</span>"
    hint = html.escape(f"{row.name}: {row.finding}")
    return _small(f"<span title='{hint}'>{dot} {number}: {html.escape(', '.join(said))}</span>")


def _small(content: str) -> str:
    return f"<div style='padding:0.2em 0.8em;font-size:0.85em'>{content}</div>"
