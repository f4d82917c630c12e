"""`dart-skill teach`: throws that a person guides, on a graph that runs."""

import argparse
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_baskets, add_namespace
from dart_skill_nodes.verbs.on_graph import PATIENCE, baskets, on_running_graph, say
from dart_skill_nodes.verbs.trials import how_it_went, show_all, teach_by_hand

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
        options.targets = baskets(options, stream=1)
        options.simulated = client.is_simulated(PATIENCE)
        if options.simulated:
            client.wait_until_ready(PATIENCE)

    def teach(client: "GraphClient") -> dict:
        from dart_skill.skills.protocol import load_skill

        skill = load_skill(client.skill(PATIENCE))
        if not options.simulated:
            return _teach_by_hand(client, options, skill)
        if skill.told_by == "landings":
            return _teach_throws(client, skill, options.targets)
        if options.at is not None:
            raise ValueError(
                f"--at is for throws: the graph teaches '{skill.name}', whose situations are drawn"
                " (--seed)"
            )
        count = options.count
        attempts = show_all(client, skill, skill.situations(options.seed, count, 0)[0], count)
        text = f"{count} of {count} movements shown, in {attempts} attempts"
        told = {"text": text, "shown": count, "attempts": attempts, "ok": True}
        return {**told, "next": "dart-skill learn"}

    return on_running_graph(options, wait, teach)


def _teach_by_hand(client: "GraphClient", options: argparse.Namespace, skill: "Skill") -> dict:
    if options.at is not None:
        raise ValueError(
            "--at puts a simulated basket there: put the real one where you like, and leave"
            " this out"
        )
    shown = teach_by_hand(client, options.count, skill.words)
    text = f"{shown} of {options.count} {skill.words.trials} shown"
    told = {"text": text, "shown": shown, "ok": shown == options.count}
    return {**told, "next": "dart-skill demonstrations"}


def _teach_throws(client: "GraphClient", skill: "Throw", targets: "np.ndarray") -> dict:
    """One lesson at each basket."""
    lessons = []
    for target in targets:
        result = client.teach(target)
        say(f"{skill.in_words(skill.at(target))}: {how_it_went(skill, result)}")
        told = {"success": bool(result.success), "attempts": int(result.attempts)}
        lessons.append({"target": target.tolist(), **told})
    shown = sum(lesson["success"] for lesson in lessons)
    return {
        "text": f"{shown} of {len(lessons)} throws shown",
        "lessons": lessons,
        "ok": shown == len(lessons),
        "next": "dart-skill learn" if shown else "dart-skill status",
    }
