"""The controls beside the scene: buttons and sliders become requests, and what goes on is told in
words and in a learning curve.
"""

from __future__ import annotations

import html
import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dart_skill.common import palette
from dart_skill.skills.learning import CONFIGURATIONS, DEFAULT
from dart_skill.skills.protocol import Skill
from dart_skill.skills.throw import Throw
from dart_skill.view._holding_controls import HoldingControls
from dart_skill.view._page_style import STYLE
from dart_skill.view._scene import GROUPS, Scene

LEVELS = ("ok", "warning", "error", "stale")
"""Levels of a node's status, as diagnostic_msgs numbers them."""
FEWEST = 2
"""Demonstrations from which something may be learned at the earliest."""
STOPPED = "/commander/reset"
"""A node whose status names this service waits for it: somebody, or a limit, has stopped the arm."""
UNHEARD = "none has been heard yet"
LONGEST_CURVE = 2000
"""Throws that the learning curve holds."""
WHOLE_STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
"""Between marks of the axis that counts throws."""
MOST_LESSONS = 30
"""Largest number of demonstrations that one click asks for; the page may send any number."""
MOST_THROWS = 50
"""Largest number of own throws that one click asks for."""


@dataclass(frozen=True)
class Request:
    """What was asked for with a control, and its details.

    Parameters
    ----------
    what
        "teach", "learn", "throw", "practice", "stop", "reset", "place_basket" or "set"; of a
        lesson with the mouse "hold", "pull", "turn", "grip", "look", "done", "discard" or "undo".
    values
        The details.
    """

    what: str
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Knob:
    """A number of a node that can be changed while it runs.

    Parameters
    ----------
    name, description
        Of the parameter.
    low, high
        Its range.
    value
        At present.
    """

    name: str
    description: str
    low: float
    high: float
    value: float


@dataclass(frozen=True)
class NodeStatus:
    """What a node says of itself.

    Parameters
    ----------
    name
        Of the node.
    level
        Index into LEVELS.
    message
        Of its diagnostics.
    """

    name: str
    level: int
    message: str


class Panel:
    """The controls of one page.

    Parameters
    ----------
    server
        Viser's server, or one client's part of it.
    scene
        What the page shows; its controls change it.
    ask
        Called in the server's threads with each Request: hand over to your own.
    skill
        Whose trials it controls, default throws at baskets.
    """

    def __init__(
        self, server: Any, scene: Scene, ask: Callable[[Request], None], skill: Skill | None = None
    ):
        self._gui, self._scene, self._ask, self._skill = server.gui, scene, ask, skill or Throw()
        self._words, self._has_basket = self._skill.words, "basket" in self._skill.bodies
        self._shown_nodes: tuple[NodeStatus, ...] = ()
        self._knobs: dict[tuple[str, str], Any] = {}
        # values of the knobs when they were heard of
        self._first: dict[tuple[str, str], float] = {}
        self._errors: list[tuple[float, bool]] = []
        self._stop = self._button("Stop", lambda: Request("stop"), palette.STOP)
        self._reset = self._button("Reset after a stop", lambda: Request("reset"))
        self._reset.disabled = True
        self._busy, self._has_model, self._n_shown = False, False, 0
        # buttons that begin something, and whether that can work now
        self._starting: list[tuple[Any, Callable[[], bool]]] = []
        self._says = self._gui.add_html(_says(""))  # below what must not move
        tabs = self._gui.add_tab_group()
        self.holding: HoldingControls | None = None
        with tabs.add_tab("Run"):
            self._add_learning()
            self._add_holding()
            self._add_throwing()
            self._add_curve()
            self._legend = self._gui.add_html("")
        self._gui.add_html(STYLE)  # last, as it takes a line
        self._show_tab = tabs.add_tab("Show")
        self._switches: set[str] = set()
        for group, label in GROUPS.items():
            self._add_switch(group, label)
        with tabs.add_tab("Nodes"):
            self._nodes = self._gui.add_html(_words(UNHEARD))
        with tabs.add_tab("Arm"):
            self._arm = self._gui.add_folder("What is different about the arm")
            with self._arm:
                self._as_before = self._gui.add_button(
                    "As they were at first", hint="every number below", visible=False
                )
                self._as_before.on_click(lambda _: self._ask_as_before())
                self._no_knobs = self._gui.add_html(
                    _words("no node has numbers that can be changed while it runs")
                )
        if self._has_basket:
            scene.on_basket_dragged(
                lambda place, done: ask(Request("place_basket", {"place": place, "done": done}))
            )
        self._allow()
        self.show_legend()
        self.say(self._welcome)

    @property
    def _welcome(self) -> str:
        return self._words.welcome + " Drag the basket to put it elsewhere." * self._has_basket

    @property
    def trial(self) -> str:
        """What a trial of the skill is called."""
        return self._words.trial

    # what it tells

    def say(self, text: str, is_error: bool = False) -> None:
        """A line about what goes on.

        Parameters
        ----------
        text
            The line.
        is_error
            Shows it as one.
        """
        self._says.content = _says(text, is_error)
        self._is_new = text == self._welcome

    def welcome_a_model(self) -> None:
        """There is a model to try; say so, if the page has said only how to teach one."""
        self._has_model = True
        self._allow()
        if self._is_new:
            self.say(
                f"A model is there: press {self._words.do}, or Teach to have more shown and learn"
                " anew."
            )

    def set_busy(self, busy: bool) -> None:
        """While something is carried out, nothing else can be asked for but to stop it.

        Parameters
        ----------
        busy
            Whether that is so.
        """
        self._busy = busy
        self._allow()

    def count_shown(self, number: int) -> None:
        """So many demonstrations are there to learn from."""
        self._n_shown = number
        self._allow()

    def _allow(self) -> None:
        for button, can_work in self._starting:
            button.disabled = self._busy or not can_work()

    def show_nodes(self, nodes: Sequence[NodeStatus]) -> None:
        """One line per node, sorted by name."""
        nodes = tuple(sorted(nodes, key=lambda node: node.name))
        if nodes != self._shown_nodes:
            self._shown_nodes = nodes
            self._reset.disabled = not any(STOPPED in node.message for node in nodes)
            self._nodes.content = "".join(_node_line(node) for node in nodes) or _words(UNHEARD)

    def show_legend(self) -> None:
        """Which colour is what, with a switch for each of several groups of Gaussians; call it
        when there is a new one.
        """
        shown = self._scene.gaussian_colours
        for group in shown if len(shown) > 1 else ():
            self._add_switch(group, group)
        seen = {
            group: colour
            for group, colour in shown.items()
            if group not in self._scene.hidden_gaussians
        }
        groups = {
            f"Gaussians: {group}" if len(seen) > 1 else "Gaussians": colour
            for group, colour in seen.items()
        }
        swatches = "".join(
            _swatch(*kind) for kind in (legend(self._scene.bodies) | groups).items()
        )
        self._legend.content = f"<div style='columns:2;padding:0.5em 0.8em'>{swatches}</div>"

    def add_throw(self, error: float, in_basket: bool) -> None:
        """A point of the learning curve: error [m], nan if it was not seen, and whether it
        succeeded: a ball, whether it went in.

        Parameters
        ----------
        in_basket
            Whether it succeeded.
        """
        self._errors.append((self._words.unit[1] * float(error), bool(in_basket)))
        del self._errors[:-LONGEST_CURVE]
        self._curve.scales = _scales(self._errors)
        self._curve.data, self._curve.visible = curve_data(self._errors), True

    def add_knobs(self, node: str, knobs: Sequence[Knob]) -> None:
        """Numbers of a node that can be changed; those that are there already get the new values.

        Parameters
        ----------
        knobs
            The numbers.
        """
        self._no_knobs.visible = self._no_knobs.visible and not knobs
        self._as_before.visible = self._as_before.visible or bool(knobs)
        with self._arm:
            for knob in knobs:
                if (node, knob.name) in self._knobs:
                    self._knobs[node, knob.name].value = knob.value
                else:
                    self._knobs[node, knob.name], self._first[node, knob.name] = (
                        self._add_knob(node, knob),
                        knob.value,
                    )

    # what it is made of

    def _add_learning(self) -> None:
        with self._gui.add_folder("Teach and learn"):
            self._lessons = self._gui.add_slider(
                "Lessons", 1, MOST_LESSONS, 1, self._words.lessons, hint=self._words.shown
            )
            teach = self._button(
                "Teach",
                lambda: Request(
                    "teach", {"demonstrations": _count(self._lessons.value, MOST_LESSONS)}
                ),
            )
            names = tuple(CONFIGURATIONS)
            self._configuration = self._gui.add_dropdown(
                "Model", names, initial_value=DEFAULT.name, hint="configuration of the skill, see docs/throwing.md",
                visible=bool(self._skill.configurations),
            )  # fmt: skip
            learn = self._button(
                "Learn",
                lambda: Request(
                    "learn",
                    {
                        "configuration": self._configuration.value
                        if self._skill.configurations
                        else ""
                    },
                ),
                hint=f"{FEWEST} demonstrations at least",
            )
        self._starting += [(teach, lambda: True), (learn, lambda: self._n_shown >= FEWEST)]

    def _add_holding(self) -> None:
        if self._skill.by_pointer:
            self.holding = HoldingControls(
                self._gui, lambda what, values: self._ask(Request(what, values))
            )
            self._starting.append((self.holding.take_button, lambda: True))

    def _add_throwing(self) -> None:
        words = self._words
        with self._gui.add_folder(f"{words.do} and practise"):
            throw = self._button(
                words.do, lambda: Request("throw"), palette.BLUE, hint="with what was learned"
            )
            self._throws = self._gui.add_slider(
                f"Own {words.trials}", 1, MOST_THROWS, 1, 10, hint="each of them is learned from"
            )
            self._follow = self._gui.add_checkbox(
                "Only here",
                False,
                hint="practise at the basket that is there, else where a throw teaches most",
                visible=self._has_basket,
            )
            practise = self._button(
                "Practise",
                lambda: Request(
                    "practice",
                    {
                        "throws": _count(self._throws.value, MOST_THROWS),
                        "follow_basket": bool(self._follow.value),
                    },
                ),
            )
        self._starting += [(one, lambda: self._has_model) for one in (throw, practise)]

    def _button(
        self,
        label: str,
        request: Callable[[], Request],
        colour: tuple[int, int, int] | None = None,
        hint: str | None = None,
    ) -> Any:
        button = self._gui.add_button(label, color=colour, hint=hint)
        button.on_click(lambda _: self._ask(request()))
        return button

    def _add_curve(self) -> None:
        uplot = importlib.import_module("viser.uplot")
        point = {"show": True, "size": 6}
        of_kind = ((self._words.done, palette.SUCCESS), (self._words.failed, palette.FAILURE))
        series = [uplot.Series(label=self._words.trial)]
        for label, colour in of_kind:
            stroke = palette.hexadecimal(colour)
            series.append(
                uplot.Series(
                    label=label,
                    stroke=stroke,
                    width=0,
                    points={**point, "stroke": stroke, "fill": stroke},
                )
            )
        number = f"own {self._words.trial}"
        axes = (
            uplot.Axis(label=number, incrs=WHOLE_STEPS),
            uplot.Axis(label=f"error [{self._words.unit[0]}]"),
        )
        none = [(np.nan, True)]
        self._curve = self._gui.add_uplot(
            curve_data(none),
            tuple(series),
            scales=_scales(none),
            axes=axes,
            height=180,
            padding=(8, 16, 0, 0),
            visible=False,
        )

    def _add_switch(self, group: str, label: str) -> None:
        if group in self._switches:
            return
        self._switches.add(group)
        with self._show_tab:
            box = self._gui.add_checkbox(label, group not in self._scene.hidden_gaussians)
        box.on_update(lambda event: self._show(group, bool(event.target.value)))

    def _show(self, group: str, visible: bool) -> None:
        self._scene.show(group, visible)
        self.show_legend()

    def _add_knob(self, node: str, knob: Knob) -> Any:
        number = self._gui.add_number(
            knob_label(knob),
            knob.value,
            min=knob.low,
            max=knob.high,
            step=_step(knob),
            hint=knob.description,
        )
        number.on_update(lambda event: self._changed(event, node, knob.name))
        return number

    def _ask_as_before(self) -> None:
        """For every number that differs from what it was when this page heard of it."""
        for (node, name), value in self._first.items():
            if (knob := self._knobs[node, name]).value != value:
                knob.value = value
                self._ask(Request("set", {"node": node, "name": name, "value": value}))

    def _changed(self, event: Any, node: str, name: str) -> None:
        if event.client is not None:  # not by `add_knobs`
            self._ask(
                Request("set", {"node": node, "name": name, "value": float(event.target.value)})
            )


def curve_data(errors: Sequence[tuple[float, bool]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Number of the throw, error of those that went in, error of those that did not (n,) each, nan
    in the other one.
    """
    values, inside = (
        np.array([error for error, _ in errors], dtype=float),
        np.array([inside for _, inside in errors], dtype=bool),
    )
    return (
        np.arange(1.0, len(values) + 1.0),
        np.where(inside, values, np.nan),
        np.where(inside, np.nan, values),
    )


def knob_label(knob: Knob) -> str:
    """The name of a number and its unit, which stands in brackets in its description."""
    unit = re.search(r"\[[^]]+\]", knob.description)
    return knob.name.replace("_", " ") + (f" {unit.group()}" if unit else "")


def _count(value: float, most: int) -> int:
    return int(min(max(value, 1), most))


def _step(knob: Knob) -> float:
    """A hundredth of the range, as a power of ten."""
    return float(10.0 ** np.floor(np.log10(max(knob.high - knob.low, 1e-9) / 100.0)))


def _says(text: str, is_error: bool = False) -> str:
    return (
        f"<div class='ds-says{' alarm' if is_error else ''}'"
        f" role='status'>{html.escape(text)}</div>"
    )


def _words(text: str) -> str:
    return f"<div class='ds-quiet'>{html.escape(text)}</div>"


def _scales(errors: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """From zero to a little above the largest error: the page's own choice stumbles over what was
    not seen.
    """
    seen = [error for error, _ in errors if np.isfinite(error)]
    return {"x": {"time": False}, "y": {"auto": False, "min": 0.0, "max": 1.1 * max([1.0, *seen])}}


def legend(bodies: Sequence[str]) -> dict[str, tuple[int, int, int]]:
    """Which colour is what, in a scene with these bodies; a board has paint of its own."""
    first = {role: palette.BALL for role in bodies[:1]}
    ways = {
        "hand's path": palette.HAND,
        "attractor": palette.ATTRACTOR,
        "demonstrations": palette.DEMONSTRATION,
    }
    return first | ways | {role: palette.BASKET for role in bodies[1:] if role != "board"}


def _swatch(label: str, colour: tuple[int, int, int]) -> str:
    return (
        "<div class='ds-swatch'><span"
        f" style='background:{palette.hexadecimal(colour)}'></span>{html.escape(label)}</div>"
    )


def _node_line(node: NodeStatus) -> str:
    level = min(max(node.level, 0), len(LEVELS) - 1)
    dot = (
        f"<span title='{LEVELS[level]}'"
        f" style='color:{palette.hexadecimal(palette.LEVELS[level])}'>&#9679;</span>"
    )
    word = "" if level == 0 else f"{LEVELS[level]}: "
    return (
        f"<div class='ds-node'>{dot} <b>{html.escape(node.name)}</b>"
        f" {html.escape(word + node.message)}</div>"
    )
