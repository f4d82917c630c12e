"""The number of components of a model, chosen from the demonstrations on request (thesis 3.2.2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dart_skill.mixture import best_number
from dart_skill.recording import Demonstration
from dart_skill.skills.learning._configuration import SkillConfiguration
from dart_skill.skills.learning._learning import learn
from dart_skill.skills.learning._outliers import FEWEST, unlike
from dart_skill.skills.learning._preparation import PreparedThrow
from dart_skill.skills.learning._throwing import LEAST_DEMONSTRATIONS, learn_prepared
from dart_skill.skills.protocol import BIC, COMPONENTS, CROSS_VALIDATION, Skill, check_way


def choose_components(skill: Skill, demonstrations: Sequence[Demonstration], way: str) -> Skill:
    """The skill with the number of components, among COMPONENTS, that is best in a way (BIC or
    CROSS_VALIDATION).

    Raises
    ------
    ValueError
        Names a demonstration that cannot be learned from, or says that there are too few.
    """

    def with_number(number: int) -> Skill:
        return type(skill)(replace(skill.settings, components=number))

    def score(number: int) -> float:
        try:
            model = learn(with_number(number), demonstrations)
        except ValueError:  # so many components that some have nothing to learn from
            return float("inf")
        return model.bic() if way == BIC else float(np.mean(np.square(unlike(model))))

    learn(skill, demonstrations)  # or a ValueError that says why nothing can be learned
    return with_number(_best(way, len(demonstrations), FEWEST, score))


def choose_throw_components(
    throws: Sequence[PreparedThrow], configuration: SkillConfiguration, way: str
) -> SkillConfiguration:
    """The configuration with the best number of components, as `choose_components` finds it.

    Parameters
    ----------
    throws
        Demonstrations prepared for the configuration.

    Raises
    ------
    ValueError
        Says that there are too few, or that BIC compares nothing.
    """

    def score(number: int) -> float:
        model = learn_prepared(throws, replace(configuration, components=number))
        return model.bic() if way == BIC else model.left_out_error()

    number = _best(way, len(throws), LEAST_DEMONSTRATIONS + 1, score)
    return replace(configuration, components=number)


def _best(way: str, shown: int, least: int, score: Callable[[int], float]) -> int:
    check_way(way)
    if way == CROSS_VALIDATION and shown < least:
        raise ValueError(
            f"{shown} demonstrations are too few to leave out each once: record at least {least}"
        )
    return best_number(COMPONENTS, score)
