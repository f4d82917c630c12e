"""What the compact docstrings of the library say of parameters, of what is returned and of errors,
as fields for Sphinx.

A docstring here is prose. Such parts of it are found with the signature at hand, and moved to a
field; the rest stays where it is:

* `name, name: text.` in an item of a list, at the start of a line or sentence, or after a
  semicolon: of these parameters.
* `name (n, 3) [m], name [s], text.` in the same places: of parameters whose shape or unit is all
  that is to be said.
* `Returns text.`, or `; returns text`, or `; whether text` of a bool: of the result.
* A sentence, or what follows a semicolon, that begins with the name of an exception: of errors.

What follows in the same paragraph belongs to the part before it.
"""

import ast
import builtins
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from itertools import groupby
from typing import Any

from as_text import ITEM, is_as_it_stands, is_list, paragraph, plain

SHAPE = r"(?: \([^()]*\))?(?: \[[^\[\]]*\])?"
NAME = rf"\*{{0,2}}([A-Za-z_]\w*)({SHAPE})"
HEAD = re.compile(rf"({NAME}(?:(?:, | and ){NAME})*):(?: |$)")
SHAPED = re.compile(rf"{NAME}(?=[,;. ]|$)(?:, | and (?=\w+ [(\[]))?")
GOES_ON = re.compile(r" ?(?:and|or|are)\b")
HEADER = re.compile(r"(Parameters|Attributes?)\b(.*):$", re.DOTALL)
GAP = re.compile(r"(?<=[.!?])\s+|;\s+")
ERRORS = re.compile(r"(?:Raises )?([A-Z]\w+(?:(?:, or |, | or | and )[A-Z]\w+)*)\b")
RETURNS = re.compile(r"(?:and )?returns? (?!(?:to|from)\b)", re.IGNORECASE)
AS_ELSEWHERE = re.compile(
    r"(?:^|[.;,] )(?:The rest|Others|Arguments|Parameters are those|As|Learn as|which are given as"
    r" to)\b(?: (?:as|in|of|for))*[^.`]*`",
    re.IGNORECASE,
)
WORD = re.compile(r"'[^']*'|\"[^\"]*\"|[A-Za-z_][\w.]*")

COMMON = {
    "rng": "where everything random is drawn from.",
    "seed": "of everything that is random.",
    "path": "of the file or folder.",
    "folder": "where the files are, or shall be.",
    "name": "what it is called.",
    "stamp_ns": "the instant, on the clock of the messages [ns].",
    "until_ns": "the last instant, on the clock of the messages [ns].",
    "opened_ns": "when the hand was told to open, on the clock of the messages [ns].",
    "role": "of a body in the skill, such as hand or ball.",
    "situation": "what a trial of the skill depends on.",
    "skill": "that is shown, learned or carried out.",
    "session": "where arm, cameras and person are simulated.",
    "demonstration": "what a person showed.",
    "demonstrations": "what a person showed, or how many times.",
    "quaternion": "orientation x, y, z, w.",
    "q": "angles of the joints [rad].",
    "qd": "velocities of the joints [rad/s].",
    "ball": "what flies, and in what air.",
    "type_name": "of a message, as ROS writes it: package/msg/Name.",
    "description": "of the arm.",
    "results": "the runs, or the file that holds them.",
    "task": "what to do in one run.",
    "jobs": "processes at a time.",
    "scheduler": "class of Linux that the processes run in.",
    "axes": "of matplotlib, to draw in.",
    "settings": "numbers that can be chosen; by default its own.",
    "thresholds": "speeds at which a motion begins and ends.",
    "poses": "of bodies, by role or name.",
    "bag_path": "the bag.",
    "msg": "the message, of rclpy or decoded without ROS.",
    "wide": "where the skill is tried, and not only where it is shown.",
    "grip": "what the fingers are told: to open, to close, or nothing.",
    "now": "on a clock that never jumps [s].",
    "now_ns": "on the clock of the messages [ns].",
    "position_ns": "log time of a message [ns].",
    "state": "of the arm, at this instant.",
    "message": "what was wrong, in words; empty if nothing was.",
    "log": "what the sensors saw.",
    "game": "what is thrown, and where it is judged.",
    "summary": "of all trials of the run.",
    "dataset": "of LeRobot, open for reading.",
    "without": "ids of demonstrations that are left out.",
    "method": "by which is learned or practised.",
    "configuration": "how throws are learned, or its name.",
    "frames": "task frames, for each demonstration or for one.",
    "weights": "how much each sample counts, equally by default.",
    "rule": "when to split and when to merge.",
    "basket": "the basket, if there is one.",
    "numbers": "what else there is to say, by name.",
    "task_type": "class of a task.",
    "run_type": "class of what came of it.",
    "ball_in_hand": "whether the arm is loaded with the ball.",
    "media_type": "of the content, as on the internet.",
}
"""What names mean wherever a docstring does not say it: one name stands for one thing."""

OTHER_WORDS = {
    "position": r"places?|points?|joints?|angles|centres?|poses?|where",
    "velocity": r"speeds?|joint state|moves",
    "time": r"instants?|when|late|stamps?|seconds|times",
    "quaternion": r"orientations?|poses?|turned|\(4,\)",
    "target": r"rims?|baskets?|points?|board|task parameter|place",
    "data": r"messages?|bytes|serialised",
    "seen": r"saw|recorded|heard|trial",
    "since_ns": r"instants?|stamps?",
    "until_ns": r"instants?|stamps?",
    "stamp_ns": r"instants?|stamps?",
}
"""Which other words in a docstring speak of a parameter, too."""


@dataclass
class Part:
    """Words of one kind: of parameters, attributes, the result, errors, or prose.

    kind: "Parameters", "Attributes", "Returns", "Raises" or "". names: each with its shape and
    unit.
    """

    kind: str
    names: list[tuple[str, str]] = field(default_factory=list)
    words: str = ""


@dataclass
class Documented:
    """An object with what is known of it without its docstring.

    parameters: annotations by name, as they stand in the code; result: likewise, None where there
    is none to speak of. attributes: names; look_up: what a dotted name of the code stands for.
    inherited: words of the base classes of a class by name.
    """

    parameters: dict[str, str]
    result: str | None
    attributes: set[str]
    look_up: Callable[[str], Any]
    inherited: dict[str, Part] = field(default_factory=dict)

    def is_error(self, name: str) -> bool:
        """Whether a name is that of an exception."""
        thing = self.look_up(name)
        return inspect.isclass(thing) and issubclass(thing, BaseException)


def _as_written(annotation: Any) -> str:
    if annotation is inspect.Parameter.empty:
        return ""
    if isinstance(annotation, str):
        return annotation
    return getattr(annotation, "__forward_arg__", None) or inspect.formatannotation(annotation)


def _written(obj: Any) -> dict[str, str]:
    """Annotations as they stand in the code, where its module has them computed."""
    found: dict[str, str] = {}
    for one in reversed(obj.__mro__[:-1]) if inspect.isclass(obj) else [obj]:
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(one)))
        except (OSError, TypeError, SyntaxError):
            continue
        body = tree.body[0]
        for node in body.body if isinstance(body, ast.ClassDef) else [body]:
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found[node.target.id] = ast.unparse(node.annotation)
            elif isinstance(node, ast.FunctionDef) and (node is body or node.name == "__init__"):
                every = [
                    *node.args.posonlyargs,
                    *node.args.args,
                    *node.args.kwonlyargs,
                    node.args.vararg,
                    node.args.kwarg,
                ]
                found |= {
                    arg.arg: ast.unparse(arg.annotation).strip("'")
                    for arg in every
                    if arg and arg.annotation
                }
    return found


def _has_parameters(obj: Any) -> bool:
    """Whether the signature is for whoever reads: not of an enumeration, an exception, or a
    protocol.
    """
    if not inspect.isclass(obj):
        return callable(obj)
    return not (issubclass(obj, (Enum, BaseException)) or getattr(obj, "_is_protocol", False))


def _names_in(module: str) -> dict[str, Any]:
    return vars(sys.modules[module]) if module in sys.modules else {}


@cache
def documented(obj: Any) -> Documented:
    """What is known of a function, a method, a property or a class."""
    obj = inspect.unwrap(obj.fget if isinstance(obj, property) else obj)
    where = (
        [_names_in(cls.__module__) for cls in obj.__mro__]
        if inspect.isclass(obj)
        else [_names_in(obj.__module__)]
    )

    def look_up(name: str) -> Any:
        first, *rest = name.split(".")
        for names in [*where, vars(builtins)]:
            if first in names:
                thing = names[first]
                for step in rest:
                    thing = getattr(thing, step, None)
                return thing
        return None

    try:
        signature = inspect.signature(obj) if _has_parameters(obj) else inspect.Signature()
    except (TypeError, ValueError):
        signature = inspect.Signature()
    if any(not isinstance(one.annotation, str) for one in signature.parameters.values()):
        written = _written(obj)
        signature = signature.replace(
            parameters=[
                one.replace(annotation=written.get(one.name, one.annotation))
                for one in signature.parameters.values()
            ]
        )
    given = [
        one
        for one in signature.parameters.values()
        if one.name not in ("self", "cls") and not one.name.startswith("_")
    ]
    parameters = {one.name: _as_written(one.annotation) for one in given}
    result = "" if inspect.isclass(obj) else _as_written(signature.return_annotation)
    known = Documented(
        parameters, None if result in ("", "None") else result, _attributes(obj), look_up
    )
    if inspect.isclass(obj):
        known.inherited = _inherited(known, obj)
    return known


def _inherited(known: Documented, cls: type) -> dict[str, Part]:
    """What the base classes of the library say of the parameters of a class, by name."""
    said: dict[str, Part] = {}
    for base in reversed(cls.__mro__[1:-1]):
        if base.__module__.startswith("dart_skill") and base.__doc__:
            for part in split(known, inspect.cleandoc(base.__doc__).splitlines())[1]:
                if part.kind == "Parameters":
                    said |= {
                        name: Part("Parameters", [(name, shape)], part.words)
                        for name, shape in part.names
                    }
    return said


def _attributes(obj: Any) -> set[str]:
    """Public names of what a class and its instances hold."""
    if not inspect.isclass(obj):
        return set()
    names: set[str] = set()
    for cls in obj.__mro__[:-1]:
        if cls is not obj and not cls.__module__.startswith("dart_skill"):
            continue
        names |= {*vars(cls), *cls.__dict__.get("__annotations__", {})}
        try:
            names |= set(re.findall(r"\bself\.(\w+)", inspect.getsource(cls)))
        except (OSError, TypeError):
            pass
    return {name for name in names if not name.startswith("_")}


def _pieces(text: str) -> Iterator[tuple[str, str]]:
    """Sentences and what semicolons part, outside brackets and backticks, each with the gap before
    it.
    """
    start, gap = 0, ""
    for found in GAP.finditer(text):
        before = text[start : found.start()]
        if before.count("`") % 2 == 0 and sum(map(before.count, "([")) <= sum(
            map(before.count, ")]")
        ):
            yield gap, before
            start, gap = found.end(), "; " if ";" in found[0] else " "
    yield gap, text[start:]


def _entries(known: Documented, piece: str) -> list[Part]:
    """Of which parameters or attributes a piece begins to speak, if it does."""
    colon = HEAD.match(piece)
    if piece.rstrip(".") in known.parameters:
        return [Part("Parameters", [(piece.rstrip("."), "")])]
    if colon:
        heads, rest = re.findall(NAME, colon[1]), piece[colon.end() :]
    else:
        heads, rest = [], piece
        while (
            (one := SHAPED.match(rest))
            and one[2]
            and known.parameters.keys() | known.attributes >= {one[1]}
        ):
            heads, rest = [*heads, (one[1], one[2])], rest[one.end() :]
        if not heads or GOES_ON.match(rest):
            return []
    names = {name for name, _ in heads}
    kind = (
        "Parameters"
        if names <= known.parameters.keys()
        else "Attributes"
        if names <= known.attributes | known.parameters.keys()
        else ""
    )
    if not kind:
        return []
    heads = [(name, shape.strip()) for name, shape in heads]
    if colon:
        return [Part(kind, heads, rest)]
    parts = [Part(kind, [head]) for head in heads]
    parts[-1].words = rest.strip(" ;").removeprefix(".")
    return parts


def _errors(known: Documented, piece: str) -> Part | None:
    found = ERRORS.match(piece)
    names = re.findall(r"[A-Z]\w+", found[1]) if found else []
    if not found or not all(map(known.is_error, names)):
        return None
    return Part(
        "Raises",
        [(name, "") for name in names],
        piece[found.end() :].strip(" ,:").removeprefix("."),
    )


def _returns(known: Documented, gap: str, piece: str) -> Part | None:
    if known.result is None:
        return None
    found = RETURNS.match(piece)
    if found and gap:
        return Part("Returns", words=piece[found.end() :])
    return (
        Part("Returns", words=piece)
        if gap == "; " and known.result == "bool" and piece.startswith("whether ")
        else None
    )


def parts_of(known: Documented, text: str, first: Part | None = None) -> list[Part]:
    """The parts of a paragraph or of an item, in order; first: what words belong to that say of
    nothing in particular.
    """
    prose = first or Part("")
    parts = [prose]
    for gap, piece in _pieces(text):
        errors, result = _errors(known, piece), _returns(known, gap, piece)
        if begun := _entries(known, piece) or [one for one in (errors, result) if one]:
            parts += begun
        elif parts[-1].kind in ("Raises", "Returns") and gap == " ":
            parts.append(Part("", words=piece))
        else:
            parts[-1].words += (gap if parts[-1].words else "") + piece
    return [part for part in parts if part.names or part.words]


def _items(lines: list[str]) -> list[str]:
    items: list[str] = []
    for line in lines:
        if not line.startswith(" "):
            items.append(ITEM.sub("", line, count=1).strip())
        else:
            items[-1] += " " + line.strip()
    return items


def split(known: Documented, lines: list[str]) -> tuple[list[list[str]], list[Part]]:
    """A docstring's paragraphs without what goes to fields, and that, in order."""
    prose: list[list[str]] = []
    parts: list[Part] = []
    blocks = [
        list(block)
        for is_text, block in groupby(lines, key=lambda line: bool(line.strip()))
        if is_text
    ]
    for block in blocks:
        is_of_entries = bool(_entries(known, block[0])) and all(
            line.startswith(" ") or _entries(known, line) for line in block
        )
        if is_list(block) or (is_as_it_stands(block) and is_of_entries):
            found = [(item, parts_of(known, item)) for item in _items(block)]
            stays = [f"* {item}" for item, its in found if not its[0].kind]
            moved = [part for _, its in found if its[0].kind for part in its]
            if stays:
                prose.append(stays)
            elif prose and (header := HEADER.match(" ".join(prose[-1]))):
                prose.pop()
                said = header[2].strip()
                moved[:0] = (
                    [Part(moved[0].kind, words=f"{said[0].upper()}{said[1:]}:")] if said else []
                )
            parts += moved
        elif is_as_it_stands(block):
            prose.append(block)
        else:
            its = parts_of(known, " ".join(line.strip() for line in block))
            words = [
                part.words if part is its[-1] else _ended(part.words)
                for part in its
                if not part.kind
            ]
            prose += [[" ".join(words)]] if words else []
            parts += [part for part in its if part.kind]
    return prose, parts


def _ended(text: str) -> str:
    """Text with a stop at its end, where a semicolon led on to what has moved."""
    return text if not text or text[-1] in ".!?:,)" else f"{text}."


def shown_type(known: Documented, annotation: str) -> str:
    """An annotation as reStructuredText: names without their modules, those of the library as
    links.
    """

    def one(found: re.Match[str]) -> str:
        if found[0][0] in "'\"":
            return plain(found[0])
        thing = known.look_up(found[0])
        if inspect.isclass(thing) and thing.__module__.startswith("dart_skill"):
            return f"\\ :py:kind:`~{thing.__module__}.{thing.__qualname__}`\\ "
        return plain(found[0].rsplit(".", 1)[-1])

    return WORD.sub(one, annotation.replace("*", "\\*"))


def _shown(known: Documented, part: Part) -> str:
    """One item of a field."""
    types = [
        known.parameters.get(name, "") if part.kind == "Parameters" else ""
        for name, _ in part.names
    ]
    together = len(set(types)) == 1 and not any(shape for _, shape in part.names)
    shown = []
    for (name, shape), annotation in zip(part.names, types, strict=True):
        kind = "" if together else shown_type(known, annotation)
        in_brackets = (
            f" ({kind}{' ' * bool(shape)}{plain(shape)})"
            if kind
            else f" {plain(shape)}" * bool(shape)
        )
        shown.append(f"**{plain(name)}**{in_brackets}")
    head = ", ".join(shown) + (
        f" ({shown_type(known, types[0])})" if together and types[0] else ""
    )
    words = _without_type(part, types)
    return " – ".join(filter(None, (head, plain(_ended(words)))))


def _without_type(part: Part, types: list[str]) -> str:
    """The words of a part without the type at their start, which stands before them."""
    for kind in types[0].split(" | ") if types and len(set(types)) == 1 else ():
        if re.match(rf"{re.escape(kind)}(?=[,.](?: |$))", part.words):
            return part.words[len(kind) + 1 :].strip()
    return part.words


def without_words(known: Documented, lines: list[str]) -> set[str]:
    """Parameters of which a docstring says nothing, neither in a field nor anywhere in it, and
    which no base class explains.
    """
    text = " ".join(lines)
    said = {
        name for part in split(known, lines)[1] for name, _ in part.names
    } | known.inherited.keys()
    return (
        set()
        if AS_ELSEWHERE.search(text)
        else {name for name in known.parameters if name not in said and not _is_told(name, text)}
    )


def _is_told(name: str, text: str) -> bool:
    """Whether a text has a name, or all words of it, in one number or the other."""
    if name in OTHER_WORDS and re.search(
        rf"(?<!\w)(?:{OTHER_WORDS[name]})(?!\w)", text, re.IGNORECASE
    ):
        return True
    if re.search(rf"\b{re.escape(name)}\b", text):
        return True
    words = [word for word in name.split("_") if word not in ("n", "is", "has", "ns")]
    return all(
        re.search(rf"\b{re.escape(word.removesuffix('s'))}(?:s|es|ed|d)?\b", text, re.IGNORECASE)
        for word in words
    )


def fields(known: Documented, parts: list[Part], unsaid: set[str]) -> list[str]:
    """The fields as reStructuredText; unsaid: parameters of which nothing is said, which get the
    words of `COMMON`.
    """
    said: dict[str, list[Part]] = {}
    for part in parts:
        for name, _ in part.names if part.kind == "Parameters" else ():
            said.setdefault(name, []).append(part)
    told: list[Part] = [part for part in parts if part.kind == "Parameters" and not part.names]
    for name, annotation in known.parameters.items():
        last = told[-1] if told else None
        if name not in said and name in known.inherited:
            told.append(replace(known.inherited[name]))
        elif name not in said and name in COMMON and name in unsaid:
            told.append(Part("Parameters", [(name, "")], COMMON[name]))
        elif name in said:
            told += [part for part in said[name] if not any(part is one for one in told)]
        elif (
            last
            and last.names
            and not last.words
            and last.names[0][0] not in known.inherited
            and last.names[0][0] not in said
            and known.parameters[last.names[0][0]] == annotation
        ):
            last.names.append((name, ""))
        else:
            told.append(Part("Parameters", [(name, "")]))
    lines = _field("Parameters", [_shown(known, part) for part in told])
    lines += _field(
        "Attributes", [_shown(known, part) for part in parts if part.kind == "Attributes"]
    )
    if known.result is not None:
        words = " ".join(plain(_ended(part.words)) for part in parts if part.kind == "Returns")
        lines += _field(
            "Returns", [" – ".join(filter(None, (shown_type(known, known.result), words)))]
        )
    return lines + _field(
        "Raises", [_shown(known, part) for part in parts if part.kind == "Raises"]
    )


def _field(name: str, items: list[str]) -> list[str]:
    if len(items) < 2:
        return [f":{name}: \\ {items[0]}", ""] if items else []
    head = [] if items[0].startswith("**") else [f"   {items[0]}", ""]
    return [f":{name}:", *head, *(f"   * {item}" for item in items[bool(head) :]), ""]


def as_rest(lines: list[str], known: Documented | None = None) -> list[str]:
    """A docstring as reStructuredText; known: of what, if it is to have fields."""
    if known is None:
        blocks = [
            list(block)
            for is_text, block in groupby(lines, key=lambda line: bool(line.strip()))
            if is_text
        ]
        return [shown for block in blocks for shown in [*paragraph(block), ""]]
    prose, parts = split(known, lines)
    return [shown for block in prose for shown in [*paragraph(block), ""]] + fields(
        known, parts, without_words(known, lines)
    )
