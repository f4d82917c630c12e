"""The number of components of a skill's model, chosen from the demonstrations on request (thesis
3.2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dart_skill.mixture import best_number
from dart_skill.skills.learning._learning import learn
from dart_skill.skills.learning._outliers import FEWEST, unlike
from dart_skill.skills.protocol import (
    BIC,
    COMPONENTS,
    CROSS_VALIDATION,
    Demonstration,
    Skill,
    check_way,
)


def choose_components(skill: Skill, demonstrations: Sequence[Demonstration], way: str) -> Skill:
    """The skill with the number of components, among COMPONENTS, that is best in a way (BIC or
    CROSS_VALIDATION).

    ValueError names a demonstration that cannot be learned from, or says that there are too few.
    """
    check_way(way)
    learn(skill, demonstrations)  # or a ValueError that says why nothing can be learned
    if way == CROSS_VALIDATION and len(demonstrations) < FEWEST:
        raise ValueError(
            f"{len(demonstrations)} demonstrations are too few to leave out each once: record at"
            f" least {FEWEST}"
        )

    def with_number(number: int) -> Skill:
        return type(skill)(replace(skill.settings, components=number))

    def score(number: int) -> float:
        try:
            model = learn(with_number(number), demonstrations)
        except ValueError:  # so many components that some have nothing to learn from
            return float("inf")
        return model.bic() if way == BIC else float(np.mean(np.square(unlike(model))))

    return with_number(best_number(COMPONENTS, score))
