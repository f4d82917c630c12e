"""Skills and their parts by name: those that come with dart_skill, and those of any installed
package that registers one.

A package registers a skill in its own metadata, under the entry-point group `dart_skill.skills`,
and a part under the group of its kind (`GROUPS`):

    [project.entry-points."dart_skill.skills"]
    stack = "my_package.stack:Stack"

    [project.entry-points."dart_skill.representations"]
    splines = "my_package.splines:Splines"
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from dart_skill.skills.protocol._skill import Skill

GROUP = "dart_skill.skills"
"""Entry-point group of skills."""
OWN = {
    "darts": "dart_skill.skills.darts:Darts",
    "place": "dart_skill.skills.place:Place",
    "reach": "dart_skill.skills.reach:Reach",
    "stir": "dart_skill.skills.stir:Stir",
    "throw": "dart_skill.skills.throw:Throw",
}
"""Those that come with dart_skill, also where it was not installed, as in a checkout."""
GROUPS = {
    "representation": "dart_skill.representations",
    "refinement": "dart_skill.refinements",
    "practice": "dart_skill.practices",
    "targets": "dart_skill.targets",
}
"""Entry-point group of each kind of part; a setting of that name chooses one (`SkillSettings`)."""
PARTS = {
    "representation": {
        "autonomous": "dart_skill.skills.learning:Autonomous",
        "dmp": "dart_skill.skills.learning:VectorPrimitive",
        "dsgmr": "dart_skill.skills.learning:FoundComponents",
        "intervals": "dart_skill.skills.learning:EqualIntervals",
        "per_step": "dart_skill.skills.learning:PerStep",
        "pose": "dart_skill.skills.learning:OnManifold",
        "pose_dmp": "dart_skill.skills.learning:PosePrimitive",
        "rhythmic": "dart_skill.skills.learning:Rhythmic",
    },
    "refinement": {
        "aim": "dart_skill.skills.learning:SolvedAim",
        "flight": "dart_skill.skills.learning:SolvedFlight",
        "none": "dart_skill.skills.learning:Refinement",
        "release": "dart_skill.skills.learning:FarthestRelease",
    },
    "practice": {
        "bootstrap": "dart_skill.skills.practice:BootstrapPractice",
        "none": "dart_skill.skills.practice:Practice",
        "residual": "dart_skill.skills.practice:ResidualPractice",
    },
    "targets": {"drawn": "dart_skill.skills.practice:TargetChoice"},
}
"""Parts that come with dart_skill for any skill, by kind and name. A skill may bring more of its
own (`Skill.parts`).
"""


class Part:
    """Base of what a setting of a skill chooses by name: how movements are encoded, what is solved
    for before a plan, how trials are learned from, what chooses the next one.
    """

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        """Why this part is of no use to a skill; empty where it is. Default: it is."""
        return ""


def skill_names() -> list[str]:
    """Names of all skills that there are."""
    return sorted(_registered(GROUP, OWN))


def skill_type(name: str) -> type[Skill]:
    """Class of the skill of that name.

    Raises
    ------
    ValueError
        Lists the names that there are, or says why it cannot be used.
    """
    # One of ours is found without a look at what is installed, which takes longer than the skill's
    # own import.
    found = {name: OWN[name]} if name in OWN else _registered(GROUP, OWN)
    if name not in found:
        raise ValueError(
            f"no skill '{name}': choose one of {', '.join(sorted(found))}, or install the package"
            " that has it"
        )
    kind = _loaded(found[name], f"skill '{name}'")
    if not (isinstance(kind, type) and issubclass(kind, Skill)):
        raise ValueError(
            f"the skill '{name}' ({found[name]}) is no class derived from"
            " dart_skill.skills.protocol.Skill"
        )
    if kind.name != name:
        raise ValueError(
            f"the skill '{name}' ({found[name]}) calls itself '{kind.name}': give both the same"
            " name"
        )
    return kind


def load_skill(
    name: str, settings: Path | None = None, changes: Mapping[str, Any] | None = None
) -> Skill:
    """The skill of that name.

    Parameters
    ----------
    settings
        File of its settings; None: those that it is configured with.
    changes
        Of these settings, by name.

    Raises
    ------
    ValueError
        For a skill, a setting or a part that there is not.
    """
    kind = skill_type(name)
    skill = kind.configured() if settings is None else kind(kind.settings_type.from_file(settings))
    if changes:
        skill = skill.with_settings(skill.settings.changed(changes, f"settings of '{name}'"))
    check_parts(skill)
    return skill


def part_names(kind: str, skill: Skill) -> list[str]:
    """Names of the parts of a kind among which a skill may choose."""
    found = _registered(GROUPS[kind], _own_parts(kind, skill))
    return sorted(
        name
        for name, value in found.items()
        if not _loaded(value, f"{kind} '{name}'").refusal(
            skill.with_settings(skill.settings.changed({kind: name}, kind))
        )
    )


def part_of(skill: Skill, kind: str) -> Any:
    """Class of a part of a skill: the one that its setting of that name chooses.

    Parameters
    ----------
    kind
        One of `GROUPS`.

    Raises
    ------
    ValueError
        If there is none of that name, it cannot be imported, or it is of no use to the skill.
    """
    name = getattr(skill.settings, kind)
    part = _part(kind, name, _own_parts(kind, skill), f" for the skill '{skill.name}'")
    if why := part.refusal(skill):
        raise ValueError(f"the {kind} '{name}' is not for the skill '{skill.name}': {why}")
    return part


def general_part(kind: str, name: str) -> Any:
    """Class of the part of that kind and name that is for any skill.

    Raises
    ------
    ValueError
        If there is none, or it cannot be imported.
    """
    return _part(kind, name, PARTS[kind])


def _own_parts(kind: str, skill: Skill) -> dict[str, str]:
    """Those that need no look at what is installed."""
    return {**PARTS[kind], **skill.parts.get(kind, {})}


def _part(kind: str, name: str, own: Mapping[str, str], whose: str = "") -> Any:
    found = own if name in own else _registered(GROUPS[kind], own)
    if name not in found:
        raise ValueError(f"no {kind} '{name}'{whose}: choose one of {', '.join(sorted(found))}")
    return _loaded(found[name], f"{kind} '{name}'")


def check_parts(skill: Skill) -> None:
    """ValueError for a part that there is not, or that is of no use to the skill. What has not
    been changed was checked when it was made, and is not imported.
    """
    usual = type(skill).settings_type()
    for kind in GROUPS:
        if getattr(skill.settings, kind) != getattr(usual, kind):
            part_of(skill, kind)


def model_type(skill: Skill) -> Any:
    """Class of what a skill learns (`Skill.model`)."""
    return _loaded(skill.model, f"model of the skill '{skill.name}'")


def _registered(group: str, own: Mapping[str, str]) -> dict[str, str]:
    """By name; what another package calls like one of ours does not take its place."""
    return {**{point.name: point.value for point in metadata.entry_points(group=group)}, **own}


def _loaded(value: str, what: str) -> Any:
    try:
        return metadata.EntryPoint(what, value, GROUP).load()
    # of another package's module: whatever it raises when it is imported
    except Exception as error:
        raise ValueError(
            f"the {what} ({value}) cannot be imported: {type(error).__name__}: {error}"
        ) from error
