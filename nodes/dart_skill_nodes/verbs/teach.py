"""`dart-skill teach`: throws that a person guides, on a graph that runs."""

import argparse
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_baskets, add_namespace
from dart_skill_nodes.verbs._run import PATIENCE, baskets, on_running_graph, print_result, say
from dart_skill_nodes.verbs._trials import how_it_went, show_all, teach_by_hand

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.skills.protocol import Skill
    from dart_skill.skills.throw import Throw
    from dart_skill_nodes.client.graph_client import GraphClient


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Throws that a person guides, on a graph that runs (`dart-skill up`): a simulated one, at"
        " new baskets for those that miss; with a real arm you, and the Enter key says when a"
        " throw begins and has ended."
    )
    add_baskets(parser, 13)
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Teach; returns the exit status."""

    def wait(client: "GraphClient") -> None:
        options.simulated = client.is_simulated(PATIENCE)
        if options.simulated:
            client.wait_until_ready(PATIENCE)

    def run() -> dict:
        from dart_skill.skills.protocol import load_skill

        targets = baskets(options, stream=1)

        def task(client: "GraphClient") -> dict:
            skill = load_skill(client.skill(PATIENCE))
            if not options.simulated:
                return _teach_by_hand(client, options, skill)
            if skill.told_by == "landings":
                return _teach(client, skill, targets)
            return _show(client, options, skill)

        return on_running_graph(wait, task, options.namespace)

    return print_result(run, options.json, options.namespace)


def _show(client: "GraphClient", options: argparse.Namespace, skill: "Skill") -> dict:
    """Lessons in another skill than throwing at baskets."""
    if options.at is not None:
        raise ValueError(
            f"--at is for throws: the graph teaches '{skill.name}', whose situations are drawn"
            " (--seed)"
        )
    lessons, _ = skill.situations(options.seed, options.count, 0)
    attempts = show_all(client, skill, lessons, options.count)
    text = f"{options.count} of {options.count} movements shown, in {attempts} attempts"
    return {
        "text": text,
        "shown": options.count,
        "attempts": attempts,
        "ok": True,
        "next": "dart-skill learn",
    }


def _teach_by_hand(client: "GraphClient", options: argparse.Namespace, skill: "Skill") -> dict:
    if options.at is not None:
        raise ValueError(
            "--at puts a simulated basket there: put the real one where you like, and leave"
            " this out"
        )
    shown = teach_by_hand(client, options.count, skill.words)
    text = f"{shown} of {options.count} {skill.words.trials} shown"
    return {
        "text": text,
        "shown": shown,
        "ok": shown == options.count,
        "next": "dart-skill demonstrations",
    }


def _teach(client: "GraphClient", skill: "Throw", targets: "np.ndarray") -> dict:
    """One lesson at each basket."""
    lessons = []
    for target in targets:
        result = client.teach(target)
        say(f"{skill.in_words(skill.at(target))}: {how_it_went(skill, result)}")
        lessons.append(
            {
                "target": target.tolist(),
                "success": bool(result.success),
                "attempts": int(result.attempts),
            }
        )
    shown = sum(lesson["success"] for lesson in lessons)
    return {
        "text": f"{shown} of {len(lessons)} throws shown",
        "lessons": lessons,
        "ok": shown == len(lessons),
        "next": "dart-skill learn" if shown else "dart-skill status",
    }
