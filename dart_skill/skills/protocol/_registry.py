"""Skills by name: those that come with dart_skill, and those of any installed package that
registers one.

A package registers a skill in its own metadata, under the entry-point group `dart_skill.skills`:

    [project.entry-points."dart_skill.skills"]
    stack = "my_package.stack:Stack"
"""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
from typing import Any

from dart_skill.skills.protocol._skill import Skill

GROUP = "dart_skill.skills"
OWN = {
    "darts": "dart_skill.skills.darts:Darts",
    "place": "dart_skill.skills.place:Place",
    "reach": "dart_skill.skills.reach:Reach",
    "throw": "dart_skill.skills.throw:Throw",
}
"""Those that come with dart_skill, also where it was not installed, as in a checkout."""


def skill_names() -> list[str]:
    """Names of all skills that there are."""
    return sorted(_entry_points())


def skill_type(name: str) -> type[Skill]:
    """Class of the skill of that name.

    Raises
    ------
    ValueError
        Lists the names that there are, or says why it cannot be used.
    """
    # One of ours is found without a look at what is installed, which takes longer than the skill's
    # own import.
    found = {name: _own(name)} if name in OWN else _entry_points()
    if name not in found:
        raise ValueError(
            f"no skill '{name}': choose one of {', '.join(sorted(found))}, or install the package"
            " that has it"
        )
    point = found[name]
    kind = _loaded(point, f"skill '{name}'")
    if not (isinstance(kind, type) and issubclass(kind, Skill)):
        raise ValueError(
            f"the skill '{name}' ({point.value}) is no class derived from"
            " dart_skill.skills.protocol.Skill"
        )
    if kind.name != name:
        raise ValueError(
            f"the skill '{name}' ({point.value}) calls itself '{kind.name}': give both the same"
            " name"
        )
    return kind


def part_of(skill: Skill, what: str) -> Any:
    """Class of a part that a skill names as "module:class": its `learner` or `target_choice`.

    Raises
    ------
    ValueError
        If it cannot be imported.
    """
    value = getattr(skill, what)
    return _loaded(metadata.EntryPoint(what, value, GROUP), f"{what} of the skill '{skill.name}'")


def load_skill(name: str, settings: Path | None = None) -> Skill:
    """The skill of that name with its settings: from a file, else those that it is configured
    with.
    """
    kind = skill_type(name)
    return kind.configured() if settings is None else kind(kind.settings_type.from_file(settings))


def _entry_points() -> dict[str, metadata.EntryPoint]:
    """By name; what another package calls like one of ours does not take its place."""
    found = {point.name: point for point in metadata.entry_points(group=GROUP)}
    return {**found, **{name: _own(name) for name in OWN}}


def _own(name: str) -> metadata.EntryPoint:
    return metadata.EntryPoint(name, OWN[name], GROUP)


def _loaded(point: metadata.EntryPoint, what: str) -> Any:
    try:
        return point.load()
    # of another package's module: whatever it raises when it is imported
    except Exception as error:
        raise ValueError(
            f"the {what} ({point.value}) cannot be imported: {type(error).__name__}: {error}"
        ) from error
