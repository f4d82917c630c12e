"""What a skill is called, what it needs, and its settings."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast

from dart_skill.arm import Speed
from dart_skill.common.configuration import arm_name, arm_path, config_path, of_the_arm
from dart_skill.recording import HAND
from dart_skill.skills.protocol._settings import SkillSettings

K = TypeVar("K", bound="SkillBase")


def settings_file(kind: type[SkillBase]) -> Path | None:
    """YAML file with the settings of a skill: in the folder skills of config/, or of another
    package the file beside its module.

    Parameters
    ----------
    kind
        Class of the skill.
    """
    try:
        return config_path(f"skills/{kind.name}.yaml")
    except FileNotFoundError:
        beside = Path(inspect.getfile(kind)).with_name(f"{kind.name}.yaml")
        return beside if beside.is_file() else None


class SkillBase:
    """The attributes that all skills have, and their settings.

    Parameters
    ----------
    settings
        Default None: those of `settings_type`.

    Attributes
    ----------
    name
        Of the skill, as `--skill` and the entry point have it.
    task
        What it does, in words, as data sets for other learners have it; empty: its name.
    bodies
        Roles of the tracked bodies that it needs beside the hand.
    world
        The simulated world in which it is shown and tried (`simulation.WORLDS`); with a real arm
        it is of no meaning.
    speed
        The level of config/limits.yaml that its movements need.
    corrects
        Role of the body whose place practice corrects; empty: practice corrects nothing.
    numbers
        Names of those that a situation may have, beside those with which the skill was shown.
    units
        Of the numbers of a situation, by name, for who reads them; one that is not here has none.
    turned
        Whether it matters how the bodies are turned that a situation names.
    model
        Class of what is learned (as `skills.learning.LearnedSkill`), as "module:class".
    parts
        Its own parts, which its settings may choose beside those for any skill: for a kind
        (`GROUPS`) "module:class" by name.
    turns_hand
        Whether the hand turns on its way.
    bodies_move
        Whether a body moves on its own while the hand is under way, so that a plan that was made
        beforehand comes too late.
    configurations
        Changes of its settings that have a name, by name.
    by_pointer
        Whether it is slow enough to be shown with a mouse.
    cuts_itself
        Whether every movement into its world is found and cut without ~/start and ~/stop.
    in_the_open
        Whether its bodies stand in the region of config/world.yaml, out of the reach of the arm.
    settings_type
        Class of its settings.
    told_by
        How a summary, a table and a page tell of its trials: "trials" (error and result of each),
        "landings" (where what was thrown came down too) or "darts" (aims and points).
    """

    name = ""
    task = ""
    bodies: tuple[str, ...] = ()
    world = "bench"
    speed = Speed.CAREFUL
    corrects = ""
    numbers: tuple[str, ...] = ()
    units: Mapping[str, str] = MappingProxyType({})
    turned = True
    model = "dart_skill.skills.learning:LearnedSkill"
    parts: Mapping[str, Mapping[str, str]] = MappingProxyType({})
    turns_hand = True
    bodies_move = False
    configurations: Mapping[str, Mapping[str, Any]] = MappingProxyType({})
    by_pointer = True
    cuts_itself = False
    in_the_open = False
    settings_type: type[SkillSettings] = SkillSettings
    told_by = "trials"

    def __init__(self, settings: SkillSettings | None = None):
        self.settings = settings or self.settings_type()

    @classmethod
    def configured(cls: type[K]) -> K:
        """The skill with the settings of its file (`settings_file`), the defaults where there is
        none, and with those that the file of the arm has for it.
        """
        path, of_arm = settings_file(cls), of_the_arm("skills", cls.name)
        settings = None if path is None else cls.settings_type.from_file(path)
        if of_arm:
            where = f"{arm_path(arm_name())}: skills: {cls.name}"
            settings = (settings or cls.settings_type()).of_configuration(of_arm, where)
        return cls(settings)

    def with_settings(self: K, settings: SkillSettings) -> K:
        """The same skill with other settings."""
        other = copy(self)
        other.settings = settings
        return other

    def named(self: K, configuration: str) -> K:
        """The same skill with a named change of its settings; an empty name changes nothing.

        Raises
        ------
        ValueError
            Lists the names that there are.
        """
        if not configuration:
            return self
        if not self.configurations:
            raise ValueError(
                f"configurations are of throws: the skill '{self.name}' has its settings in"
                f" config/skills/{self.name}.yaml"
            )
        if configuration not in self.configurations:
            raise ValueError(
                f"no configuration '{configuration}': choose one of"
                f" {', '.join(sorted(self.configurations))}"
            )
        return self.with_settings(replace(self.settings, **self.configurations[configuration]))

    @property
    def reacts(self) -> bool:
        """Whether the model is asked at every state of the arm, with the newest poses of the bodies,
        which may move. Otherwise a plan is made beforehand.
        """
        from dart_skill.skills.protocol._registry import part_of  # which loads skills

        return part_of(cast(Any, self), "representation").driven_by(self) == "state"

    @property
    def watched(self) -> bool:
        """Whether its motions are corrected by what the cameras see on the way: all but those that
        are as fast as a throw.
        """
        return self.speed == Speed.CAREFUL

    @property
    def moves(self) -> str:
        """Role of what the movement moves, without which it is not seen what comes of it: the first
        body, or the hand where there is none.
        """
        return self.bodies[0] if self.bodies else HAND

    @property
    def in_hand(self) -> str:
        """Role of the body that is in the hand when a movement begins: with a real arm a person puts
        it there before each trial. Default: empty, there is none.
        """
        return ""

    @property
    def standing(self) -> tuple[str, ...]:
        """Roles of the bodies that stand at rest before a trial, where the cameras see them: all
        but the one in the hand.
        """
        return tuple(role for role in self.bodies if role != self.in_hand)

    @property
    def started_by(self) -> str:
        """Role of the body with whose motion a trial beside a real arm begins, as that of a cup on
        a belt. Default: empty, it begins when the person has stood back.
        """
        return ""

    @property
    def in_the_way(self) -> str:
        """Role of the body that is at the hand after a movement: with a real arm a person takes it
        away before the arm goes back. Default: empty, there is none.
        """
        return ""

    @property
    def situated(self) -> tuple[str, ...]:
        """Roles of the bodies on whose poses a plan depends. Default: all that the skill needs; of
        a skill that reacts, none.
        """
        return () if self.reacts else self.bodies

    def check_known(
        self, bodies: Iterable[str], numbers: Iterable[str], shown: Iterable[str] = ()
    ) -> None:
        """ValueError for a body or a number that the skill does not have.

        * bodies, numbers: their names in a situation that is asked for.
        * shown: names of further numbers, with which it was shown.
        """
        known = {"body": (HAND, *self.bodies), "number": (*self.numbers, *shown)}
        for what, given in (("body", bodies), ("number", numbers)):
            if unknown := sorted(set(given) - set(known[what])):
                has = f"only {', '.join(known[what])}" if known[what] else "none"
                raise ValueError(
                    f"the situation names the {what} '{unknown[0]}', which '{self.name}' does not"
                    f" have: it has {has}"
                )
