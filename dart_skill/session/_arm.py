"""Parameters of all nodes for an arm of config/fleet.yaml, for sessions in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from dart_skill.common.configuration import node_file, node_parameters
from dart_skill.common.fleet import arm_with

HAS = {"wam_simulator", "mock_optitrack", "teacher", "commander"}
"""Nodes whose part a session plays."""


def parameters_of_arm(name: str, settings: Iterable[str] = ()) -> Callable[[str], dict[str, Any]]:
    """From the name of a node to its parameters.

    name: of an arm of config/fleet.yaml, "ideal" or another one, or "fleet:SEED"; settings:
    further parameters, each as NODE.PARAMETER=VALUE. ValueError for parameters of a node that no
    session has.
    """
    differs = arm_with(name, settings)
    if unknown := set(differs) - HAS:
        raise ValueError(
            f"config/fleet.yaml: the arm '{name}' sets parameters of {', '.join(sorted(unknown))},"
            " which no session has"
        )
    return lambda node: {**node_parameters(node_file(node), node), **differs.get(node, {})}
