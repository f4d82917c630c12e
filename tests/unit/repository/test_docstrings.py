"""Docstrings have the sections of numpydoc, and these are about what is there."""

import ast
import importlib
import inspect
import pkgutil
import re
import textwrap

import dart_skill

SECTION = re.compile(
    r"^(Parameters|Raises)\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", re.MULTILINE | re.DOTALL
)


def exported():
    """(name, object) of all that a package of the library offers, and the modules of common."""
    for module in pkgutil.walk_packages(dart_skill.__path__, "dart_skill."):
        if module.name.endswith("__main__"):
            continue
        loaded = importlib.import_module(module.name)
        own = [
            n for n in vars(loaded) if module.name.startswith("dart_skill.common.") and n[0] != "_"
        ]
        for name in getattr(loaded, "__all__", own):
            yield f"{module.name}.{name}", getattr(loaded, name)


def public():
    """(name, object) of every function, class and method that is exported."""
    for name, thing in exported():
        if not getattr(thing, "__module__", "").startswith("dart_skill"):
            continue
        if inspect.isclass(thing):
            yield name, thing
            for method in vars(thing):
                function = inspect.unwrap(getattr(thing, method))
                if inspect.isroutine(function) and not method.startswith("_"):
                    yield f"{name}.{method}", getattr(function, "__func__", function)
        elif inspect.isfunction(inspect.unwrap(thing)):
            yield name, inspect.unwrap(thing)


def section(thing, title):
    """Names in a section of a docstring."""
    text = inspect.getdoc(thing) or ""
    heads = [body for name, body in SECTION.findall(text) if name == title]
    lines = [line for line in "".join(heads).splitlines() if line and not line.startswith(" ")]
    return {name.strip(" *") for line in lines for name in line.split(" : ")[0].split(",")}


def test_parameters_that_docstrings_tell_of_are_those_of_the_signature():
    wrong, told = [], 0
    for name, thing in public():
        names = section(thing, "Parameters")
        told += len(names)
        try:
            known = set(inspect.signature(thing).parameters) if names else set()
        except ValueError:  # a compiled class has none
            continue
        wrong += [f"{name}: {one}" for one in sorted(names - known)]
    assert told > 1000 and not wrong, "\n".join(wrong)


def raised(function):
    """Exceptions that the body of a function raises itself, by name."""
    body = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raises = (node.exc for node in ast.walk(body) if isinstance(node, ast.Raise))
    calls = (exc.func for exc in raises if isinstance(exc, ast.Call))
    names = {ast.unparse(call).rsplit(".", 1)[-1] for call in calls}
    return {name for name in names if name[:1].isupper() and name.endswith(("Error", "Refused"))}


def documentation(name, thing):
    """The docstring of a function, with those of the methods that it overrides."""
    owner = inspect.getmodule(thing)
    *_, cls, method = [None, *name.split(".")]
    classes = getattr(vars(owner).get(cls), "__mro__", ())
    return " ".join(
        [
            thing.__doc__ or "",
            *(getattr(vars(c).get(method), "__doc__", "") or "" for c in classes),
        ]
    )


def test_errors_that_a_function_raises_are_named_in_its_docstring():
    missing = [
        f"{name}: {error}"
        for name, thing in public()
        if inspect.isfunction(thing)
        for error in sorted(raised(thing))
        if error not in documentation(name, thing)
    ]
    assert not missing, "\n".join(missing)
