"""Arms to try a skill on: by name, or drawn at random from the ranges of config/fleet.yaml."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from dart_skill.common.configuration import (
    NoSection,
    arm_names,
    config_path,
    described_parameters,
    kind_of,
    load_yaml,
    node_file,
    node_parameters,
)
from dart_skill.common.entries import (
    Each,
    Entries,
    Kind,
    Number,
    Rows,
    wrong,
)

FLEET = "fleet"
OF_SKILL = "skill."
"""Begin of a setting of the skill, which every node that knows the skill is told."""
NODES_OF_SKILL = (
    "commander",
    "coach",
    "demonstration_recorder",
    "mock_optitrack",
    "skill_learner",
    "teacher",
    "viewer",
    "wam_simulator",
)
"""Nodes that know the skill."""
FLEET_FILE = "fleet.yaml"
"""File of config/ with the arms."""
MOST = 1e6
"""Largest number of a range."""
NUMBER = Number(-MOST, MOST)
RANGES = ("between", "normal")
RULE = Entries(
    {},
    {
        **dict.fromkeys(RANGES, Rows(NUMBER, (2,))),
        "choice": Rows(NUMBER),
        "each": Number(1, 100, whole=True),
        "times": Rows(NUMBER),
    },
)
"""How a parameter is drawn."""
Arm = dict[str, dict[str, Any]]
"""Parameters that differ from those of config/, by node."""


def arm_named(name: str) -> Arm:
    """An arm of config/fleet.yaml: one of its names, or fleet:SEED for the one that this seed
    draws.

    Raises
    ------
    ValueError
        Names what there is.
    """
    content = _arms()
    family, _, seed = name.partition(":")
    if family == FLEET and seed.isdecimal():
        return drawn(content["fleet"], int(seed))
    if name in content["arms"]:
        return {node: dict(parameters) for node, parameters in content["arms"][name].items()}
    raise ValueError(
        f"no arm '{name}': choose {FLEET}:SEED, as in {FLEET}:3, or one of"
        f" {', '.join(content['arms'])}; robots are {', '.join(arm_names())}"
    )


def _arms() -> dict:
    """What the file says; ConfigurationError where it is not as it must be."""
    content = load_yaml(FLEET_FILE)
    kind = Entries({"arms": Each(_arm(kind_of)), FLEET: _arm(lambda row: _Drawn(kind_of(row)))})
    kind.check(content, str(config_path(FLEET_FILE)))
    return content


def _arm(kind: Callable[[Mapping[str, Any]], Kind]) -> Kind:
    """Parameters by node. kind: of one, by its row of parameters.yaml."""
    return Entries(
        {},
        {
            node: Entries({}, {name: kind(row) for name, row in rows.items()})
            for node, rows in described_parameters().items()
        },
    )


@dataclass(frozen=True)
class _Drawn:
    """A value of a kind, or a rule by which it is drawn."""

    of: Kind

    def check(self, value: Any, name: str) -> None:
        """See `Kind`."""
        if not isinstance(value, Mapping):
            self.of.check(value, name)
            return
        RULE.check(value, name)
        if len({*RANGES, "choice"} & set(value)) != 1:
            raise wrong(dict(value), name, "a rule with one of between, normal, choice")
        low, high = value.get("between", (0.0, 0.0))
        if low > high or value.get("normal", (0.0, 0.0))[1] < 0.0:
            raise wrong(
                dict(value), name, "between two numbers in order, or normal with a deviation"
            )


def arm_with(name: str, settings: Iterable[str]) -> Arm:
    """An arm as `arm_named` gives it, with further parameters, each as NODE.PARAMETER=VALUE.

    Raises
    ------
    ValueError
        Names what does not exist.
    """
    differs, settings = arm_named(name), list(settings)
    if of_skill := skill_settings(settings):
        told = yaml.safe_dump(of_skill, default_flow_style=True, width=1e6).strip()
        for node in NODES_OF_SKILL:
            differs.setdefault(node, {})["skill_settings"] = told
    for text in of_nodes(settings):
        node, parameter, value = _setting(text)
        differs.setdefault(node, {})[parameter] = value
    return differs


def skill_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Settings of the skill among texts NODE.PARAMETER=VALUE, by name: those of the node "skill",
    each value as YAML.

    Raises
    ------
    ValueError
        For one without a value.
    """
    found = {}
    for text in filter(_is_of_skill, settings):
        name, equals, given = text.removeprefix(OF_SKILL).partition("=")
        if not (name and equals and given):
            raise ValueError(f"--set {text}: give skill.NAME=VALUE, as in skill.components=16")
        found[name] = yaml.safe_load(given)
    return found


def of_nodes(settings: Iterable[str]) -> tuple[str, ...]:
    """Those of the texts NODE.PARAMETER=VALUE that are not settings of the skill."""
    return tuple(text for text in settings if not _is_of_skill(text))


def _is_of_skill(text: str) -> bool:
    return text.startswith(OF_SKILL)


def _setting(text: str) -> tuple[str, str, object]:
    """Node, parameter and value of NODE.PARAMETER=VALUE, the value as YAML and of the kind that
    the parameter has.
    """
    where, equals, given = text.partition("=")
    node, dot, name = where.partition(".")
    if not (equals and dot and given):
        raise ValueError(
            f"--set {text}: give NODE.PARAMETER=VALUE, as in mock_optitrack.noise=0.001"
        )
    try:
        usual = node_parameters(node_file(node), node)
    except (FileNotFoundError, NoSection):
        raise ValueError(
            f"--set {text}: there is no node {node} with parameters in config/"
        ) from None
    if name not in usual:
        raise ValueError(
            f"--set {text}: {node} has no parameter {name}; it has {', '.join(sorted(usual))}"
        )
    value = yaml.safe_load(given)
    if isinstance(usual[name], float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not type(usual[name]):
        raise ValueError(
            f"--set {text}: {value!r} is no {type(usual[name]).__name__}, which {name} is"
        )
    return node, name, value


def drawn(ranges: Mapping[str, Mapping[str, Any]], seed: int) -> Arm:
    """Every parameter drawn from its range. Each has a generator of its own, so that a new one
    changes none of the others.
    """
    return {
        node: {
            name: _draw(rule, np.random.default_rng([seed, zlib.crc32(f"{node}.{name}".encode())]))
            for name, rule in rules.items()
        }
        for node, rules in ranges.items()
    }


def _draw(rule: Any, rng: np.random.Generator) -> Any:
    """One value, or a list of them, by a rule of config/fleet.yaml; what is no rule is the value."""
    if not isinstance(rule, Mapping):
        return rule
    if "choice" in rule:
        return rule["choice"][int(rng.integers(len(rule["choice"])))]
    count = rule.get("each", 1)
    if "between" in rule:
        low, high = rule["between"]
        values = rng.uniform(low, high, count)
    else:
        mean, deviation = rule["normal"]
        values = rng.normal(mean, deviation, count)
    if "times" in rule:
        values = values * np.array(rule["times"])
    return values.tolist() if "each" in rule or "times" in rule else float(values[0])
