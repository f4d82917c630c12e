"""What docstrings say of parameters, results and errors becomes fields of the website, and nothing
of it is forgotten.
"""

import ast
import importlib
import inspect
import itertools
import re
import sys
import textwrap
from collections import Counter
from functools import cache

from tests.paths import DOCS

sys.path.insert(0, str(DOCS / "_ext"))
import fields  # noqa: E402


class Basket:
    """A basket.

    * place (3,) [m], frame: of its rim; world: where it stands.

    Attributes after `fill`:

    * n_balls: in it.
    """

    def __init__(self, place: "list[float]", frame: str, world: "Basket | None" = None):
        self.place, self.frame, self.world, self.n_balls = place, frame, world, 0


def throw(ball: str, target: "fields.Part", speed: float = 1.0, *, rng: object = None) -> bool:
    """Throw a ball (e.g. red: it is fast) at a place; returns whether it is in. target: of a_b;
    speed [m/s]: of it. At least 1.

    More; ValueError for a speed below 1. FileNotFoundError, OSError if `there; is: none`. It may
    be slow.
    """
    return bool(ball)


def shown(obj) -> str:
    return "\n".join(
        fields.as_rest(inspect.cleandoc(obj.__doc__).splitlines(), fields.documented(obj))
    )


def test_a_function_has_fields_and_keeps_the_rest_of_its_prose():
    assert shown(throw) == textwrap.dedent(
        """\
        \\ Throw a ball (e.g. red: it is fast) at a place.

        \\ More. It may be slow.

        :Parameters:
           * **ball** (str)
           * **target** (Part) – of a\\_b.
           * **speed** (float [m/s]) – of it. At least 1.
           * **rng** (object) – where everything random is drawn from.

        :Returns: \\ bool – whether it is in.

        :Raises:
           * **ValueError** – for a speed below 1.
           * **FileNotFoundError**, **OSError** – if ``there; is: none``.
        """
    ).replace("``there; is: none``", "\\ ``there; is: none``\\ ")


def test_a_class_has_its_attributes_too():
    assert shown(Basket) == textwrap.dedent(
        """\
        \\ A basket.

        :Parameters:
           * **place** (list[float] (3,) [m]), **frame** (str) – of its rim.
           * **world** (Basket | None) – where it stands.

        :Attributes:
           After \\ ``fill``\\ :

           * **n\\_balls** – in it.
        """
    )


def public():
    """Every function, class and method with a docstring that the pages of the API show: its name,
    itself, and the docstring.
    """
    seen = set()
    for page in sorted((DOCS / "api").glob("*.rst")):
        for name in re.findall(r"automodule:: (\S+)", page.read_text(encoding="utf-8")):
            try:
                module = importlib.import_module(name)
            except ModuleNotFoundError:
                continue  # of an extra that is not installed here
            for offered in getattr(module, "__all__", None) or [
                key for key, value in vars(module).items() if _is_of(value, name, key)
            ]:
                thing = getattr(module, offered)
                if (
                    id(thing) in seen
                    or not (inspect.isclass(thing) or inspect.isroutine(thing))
                    or not thing.__doc__
                ):
                    continue
                seen.add(id(thing))
                yield f"{name}.{offered}", thing, inspect.cleandoc(thing.__doc__)
                for key, value in vars(thing).items() if inspect.isclass(thing) else ():
                    method = (
                        value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
                    )
                    text = (
                        inspect.getdoc(getattr(thing, key))
                        if inspect.isfunction(method) and not key.startswith("_")
                        else None
                    )
                    if text:
                        yield f"{name}.{offered}.{key}", method, text


def _is_of(value, module: str, name: str) -> bool:
    return not name.startswith("_") and getattr(value, "__module__", None) == module


@cache
def all_public():
    """The same with what `fields` knows of each, once for all tests, and not before the first."""
    return [(name, thing, fields.documented(thing), text) for name, thing, text in public()]


MOVED = ("raises", "return", "returns", "parameters", "attributes", "attribute", "and", "or")
"""Words that become the name of a field, or part what stands in one."""


def words_of(text: str) -> Counter:
    return Counter(word for word in re.findall(r"\w+", text.lower()) if word not in MOVED)


def test_no_word_of_a_docstring_is_lost_and_none_is_shown_twice():
    for name, _, known, text in all_public():
        prose, parts = fields.split(known, text.splitlines())
        kept = [line for block in prose for line in block]
        kept += [words for part in parts for words in (part.words, *itertools.chain(*part.names))]
        told, written = words_of(" ".join(kept)), words_of(text)
        assert told == written, f"{name}: lost {written - told}, twice {told - written}"


def test_every_parameter_has_words():
    """In its docstring, in that of a base class, in one that it names, or in `fields.COMMON` for a
    name that means the same everywhere.
    """
    told = [(name, known, text.splitlines()) for name, _, known, text in all_public()]
    without = [
        f"{name}: {one}"
        for name, known, lines in told
        for one in sorted(fields.without_words(known, lines) - fields.COMMON.keys())
    ]
    assert len(told) > 1000 and sum(len(known.parameters) for _, known, _ in told) > 3000
    assert not without, f"{len(without)} parameters without words:\n" + "\n".join(without)


def test_each_parameter_of_a_class_stands_in_a_list():
    """`* name: ...`, or `* name, other: ...` where one text is of several; not `name: ...` without
    the mark of an item.
    """
    found = []
    for name, thing, known, text in all_public():
        parameters = set(known.parameters) if inspect.isclass(thing) else set()
        heads = (re.match(r"(\w+(?:, \w+)*): ", line) for line in text.splitlines())
        found += [
            f"{name}: {head[0]}"
            for head in heads
            if head and set(head[1].split(", ")) <= parameters
        ]
    assert not found, "\n".join(found)


def test_nothing_is_said_twice_of_a_parameter():
    for name, _, known, text in all_public():
        parts = fields.split(known, text.splitlines())[1]
        said = Counter((one, part.words.rstrip(".")) for part in parts for one, _ in part.names)
        assert not (twice := [one for one in said if said[one] > 1]), f"{name}: {twice}"


def test_common_words_are_for_names_of_which_a_docstring_may_say_nothing():
    unsaid = {
        one
        for _, _, known, text in all_public()
        for one in fields.without_words(known, text.splitlines())
    }
    assert fields.COMMON.keys() <= unsaid, f"no parameter needs {fields.COMMON.keys() - unsaid}"


def raised(thing, known) -> set[str]:
    """Exceptions that the body of a function raises itself, by name."""
    body = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(thing))))
    calls = [
        node.exc.func
        for node in ast.walk(body)
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)
    ]
    names = {ast.unparse(call).rsplit(".", 1)[-1] for call in calls}
    return {name for name in names if known.is_error(name)}


def test_errors_that_a_function_raises_are_named_in_its_docstring():
    unnamed = [
        (name, raised(thing, known), text)
        for name, thing, known, text in all_public()
        if not inspect.isclass(thing)
    ]
    assert sum(bool(errors) for _, errors, _ in unnamed) > 150
    missing = [
        f"{name}: {error}"
        for name, errors, text in unnamed
        for error in sorted(errors)
        if not re.search(rf"\b{error}\b", text)
    ]
    assert not missing, "errors that no docstring names:\n" + "\n".join(missing)
