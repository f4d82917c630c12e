"""`dart-skill practice`: over the real graph, a few demonstrations, then throw after throw, each of which the arm learns from."""

import argparse
import json
import time
from functools import partial
from typing import TYPE_CHECKING

from dart_skill.cli.names import CHANGES, PRACTICE_METHODS
from dart_skill.cli.run_options import add_namespace, add_run, asked, check_run, parameter_texts
from dart_skill.files import new_file
from dart_skill_nodes.process.graph_processes import LAYOUTS, NODES, Graph, of_executables
from dart_skill_nodes.verbs._run import PATIENCE, carried_out, on_running_graph, print_result, say, teach, tell_practice
from dart_skill_nodes.verbs._skill_run import THROW, practise

if TYPE_CHECKING:
    from dart_skill.session import ThrowResult
    from dart_skill_nodes.client.graph_client import GraphClient

BLOCK = 5
"""Throws per line of the table."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Practice over the real graph: a few demonstrations, then throw after throw, each of which the arm learns from. With --running on "
        "a graph that runs and has learned, as that of a real arm: a person is told when to put the ball into the hand."
    )
    add_run(parser, demonstrations=3, throws=20, thrown="own throws")
    methods = [name for name in PRACTICE_METHODS if name != "power"]
    parser.add_argument("--method", choices=methods, help="default: of config/skill_learner.yaml")
    parser.add_argument("--change", choices=sorted(CHANGES), default="none", help="what happens to the arm, unannounced (default none)")
    parser.add_argument("--change-after", type=int, default=5, metavar="N", help="own throws before the change (default 5)")
    running = parser.add_argument_group("on a graph that runs (dart-skill up)")
    running.add_argument("--running", action="store_true", help="practise there: no graph is started, nothing is taught, no report is made")
    add_namespace(running)
    where = running.add_mutually_exclusive_group()
    where.add_argument("--at", type=float, nargs=3, metavar=("X", "Y", "Z"), help="centre of the rim [m] (default: as the cameras see it)")
    where.add_argument("--choose", action="store_true", help="the coach chooses the baskets, where throws are worst")
    parser.add_argument("--json", action="store_true", help="every throw as JSON on stdout instead of the table")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Practise; returns the exit status."""
    from dart_skill.report import PAGE

    if options.running:
        _refuse_what_starts_a_graph(options, parser)
        task, namespace = partial(_practise_there, options=options), options.namespace
        return print_result(lambda: on_running_graph(_reach_coach, task, namespace), options.json, namespace)
    if options.at is not None or options.choose or options.namespace:
        parser.error("--at, --choose and --namespace are for a graph that runs: add --running")
    check_run(parser, options)
    if options.change_after < 0:
        parser.error(f"--change-after is {options.change_after}; it must be at least 0")
    if options.change != "none" and options.change_after >= options.throws:
        parser.error(f"--change-after is {options.change_after}: there are {options.throws} throws only")
    summary = carried_out(run, options, "practice")
    if summary is None:
        return 1
    print(json.dumps(summary, indent=1) if options.json else table(summary))
    try:
        write_report(summary, options, asked(parser, options))
    except (ValueError, OSError) as error:
        say(f"no report: {error}")
        return 1
    if not options.json:
        print(f"\nbag, summary.json and report.html: {options.output}")
        print(f"next: open {options.output / PAGE} in a browser, or dart-skill view {summary['bag']}")
    return 0 if summary["thrown"] == options.throws else 1


def _refuse_what_starts_a_graph(options: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    """A usage error for options that say something of a graph which is not started."""
    for name in ("seed", "demonstrations", "output", "layout", "arm", "set", "method", "change", "change_after"):
        if getattr(options, name) != parser.get_default(name):
            parser.error(f"--{name.replace('_', '-')} is for a graph that is started: leave out --running, or this")
    if options.throws < 1:
        parser.error(f"--throws is {options.throws}; it must be at least 1")


def _reach_coach(client: "GraphClient") -> None:
    client.is_simulated(PATIENCE)


def _practise_there(client: "GraphClient", options: argparse.Namespace) -> dict:
    """Own throws on a graph that runs, each of which is learned from."""
    if (skill := client.skill(PATIENCE)) != THROW:
        return _practise_skill(client, options, skill)
    messages: dict[int, str] = {}
    wanted = {} if options.choose else {"follow_basket": True} if options.at is None else {"targets": [options.at]}
    result = client.practise(options.throws, **wanted, on_feedback=partial(tell_practice, before=0, messages=messages))
    throws = [_as_row(outcome, messages.get(k, "")) for k, outcome in enumerate(result.outcomes, start=1)]
    told = {"thrown": int(result.executed), "learned": int(result.learned), "throws": throws}
    return {"text": result.message, **told, "ok": bool(result.success), "next": "dart-skill throw"}


def _practise_skill(client: "GraphClient", options: argparse.Namespace, skill: str) -> dict:
    """Own trials of another skill, where the coach lets it be tried."""
    if options.at is not None:
        raise ValueError(f"--at is for throws: the graph practises '{skill}', whose situations the coach draws")
    result, trials = practise(client, options.throws)
    told = {"executed": int(result.executed), "learned": int(result.learned), "trials": [one.to_json() for one in trials]}
    return {"text": result.message, **told, "ok": bool(result.success), "next": "dart-skill execute"}


def run(options: argparse.Namespace) -> dict:
    """The whole job on a graph of its own."""
    from dart_skill.simulation import CHANGES as VALUES
    from dart_skill_nodes.client.graph_client import GraphClient

    if options.method:
        options.differs.setdefault("skill_learner", {})["practice_method"] = options.method
    extra = of_executables(options.layout, options.differs)
    with Graph(options.output / "logs") as graph:
        say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])}")
        client = GraphClient(graph.dead)
        client.wait_until_gone(NODES)
        graph.start_all(options.layout, options.seed, options.output / "bag", extra)
        client.wait_until_ready()
        teach(client, options.seed, options.demonstrations)
        say(client.learn().message)
        begun = time.monotonic()
        blocks = [options.throws] if options.change == "none" else [options.change_after, options.throws - options.change_after]
        results, messages = [], {}
        for block, throws in enumerate(blocks):
            if block:
                client.set_parameters("wam_simulator", VALUES[options.change])
                say(f"from now on: {options.change}")
            if throws:
                before = sum(len(result.outcomes) for result in results)
                results.append(client.practise(throws, on_feedback=partial(tell_practice, before=before, messages=messages)))
        took = time.monotonic() - begun
        client.close()
    outcomes = [outcome for result in results for outcome in result.outcomes]
    throws = [_as_row(outcome, messages.get(number, "")) for number, outcome in enumerate(outcomes, start=1)]
    return {
        **_of_any_skill(throws), "wall_seconds": round(took, 1),
        "seed": options.seed, "demonstrations": options.demonstrations, "thrown": sum(result.executed for result in results),
        "learned": sum(result.learned for result in results), "change": options.change, "change_after": options.change_after,
        "seconds": round(took, 1), "message": results[-1].message, "bag": str(options.output / "bag"), "throws": throws,
    }  # fmt: skip


def _of_any_skill(throws: list[dict]) -> dict:
    """What the summary of a run has, whatever the skill."""
    from dart_skill.session import error_quantile

    results = _results(throws)
    counts = {"skill": THROW, "tried": len(results), "succeeded": sum(one.in_basket for one in results)}
    return {**counts, "median_error_m": error_quantile(results, 0.5), "trials": [one.as_trial() for one in results]}


def _results(throws: list[dict]) -> "list[ThrowResult]":
    from dart_skill.session import ThrowResult

    names = ("target_m", "landing_m", "error_m", "in_basket", "message")
    return [ThrowResult(*(row[name] for name in names)) for row in throws]


def _as_row(outcome, message: str) -> dict:
    from dart_skill_nodes.comms import conversions

    seen = bool(outcome.seen)
    return {
        "target_m": conversions.target_of(outcome.situation).tolist(),
        "landing_m": conversions.seen_at(outcome, conversions.LANDING).tolist() if seen else None,
        "error_m": float(outcome.error) if seen else None,
        "in_basket": bool(outcome.success),
        "message": message,
    }


def table(summary: dict) -> str:
    """Errors in blocks of throws."""
    import numpy as np

    lines = [f"{'throws':>10}{'in':>8}{'median [cm]':>14}{'worst [cm]':>13}"]
    for first in range(0, len(summary["throws"]), BLOCK):
        block = summary["throws"][first : first + BLOCK]
        errors = 100 * np.array([row["error_m"] for row in block if row["error_m"] is not None])
        numbers = f"{np.median(errors):>14.1f}{errors.max():>13.1f}" if len(errors) else f"{'not seen':>14}"
        span, inside = f"{first + 1}-{first + len(block)}", sum(row["in_basket"] for row in block)
        lines.append(f"{span:>10}{f'{inside}/{len(block)}':>8}{numbers}")
    done = f"{summary['thrown']} throws made, {summary['learned']} learned from, in {summary['seconds']:.0f} s"
    return "\n".join([*lines, done])


def write_report(summary: dict, options: argparse.Namespace, asked_for: list[tuple]) -> None:
    """summary.json, and the page beside it."""
    from dart_skill.report import PAGE, About, write_page

    with new_file(options.output / "summary.json", replace=True) as file:
        file.write((json.dumps(summary, indent=1, allow_nan=False) + "\n").encode())
    changed = options.change != "none"
    facts = {
        "Seed": str(options.seed),
        "Change": f"{options.change}, after {options.change_after} own throws, unannounced" if changed else "none",
        "Learned from": f"{summary['learned']} of {summary['thrown']} own throws, besides {options.demonstrations} demonstrations",
        "Time": f"{summary['seconds']:.0f} s for the own throws",
    }
    marks = {options.change_after: options.change} if changed else {}
    title = f"Practice: {options.demonstrations} demonstrations, {summary['thrown']} own throws"
    about = About(title, facts, asked_for, parameter_texts(), marks=marks)
    write_page(summary["bag"], options.output / PAGE, about, _results(summary["throws"]))
