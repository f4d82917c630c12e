"""The number of components of a throw's model, chosen from the demonstrations on request (thesis
3.2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dart_skill.mixture import best_number
from dart_skill.skills.learning._configuration import SkillConfiguration
from dart_skill.skills.learning._preparation import PreparedThrow
from dart_skill.skills.learning._throwing import LEAST_DEMONSTRATIONS, learn_prepared
from dart_skill.skills.protocol import BIC, COMPONENTS, CROSS_VALIDATION, check_way


def choose_throw_components(
    throws: Sequence[PreparedThrow], configuration: SkillConfiguration, way: str
) -> SkillConfiguration:
    """The configuration with the number of components, among COMPONENTS, that is best in a way
    (BIC or CROSS_VALIDATION).

    throws: demonstrations prepared for the configuration. ValueError says that there are too few,
    or that BIC compares nothing.
    """
    check_way(way)
    if way == CROSS_VALIDATION and len(throws) <= LEAST_DEMONSTRATIONS:
        raise ValueError(
            f"{len(throws)} demonstrations are too few to leave out each once: record at least"
            f" {LEAST_DEMONSTRATIONS + 1}"
        )

    def score(number: int) -> float:
        model = learn_prepared(throws, replace(configuration, components=number))
        return model.bic() if way == BIC else model.left_out_error()

    return replace(configuration, components=best_number(COMPONENTS, score))
