"""`dart-skill practice`: over the real graph, a few demonstrations, then throw after throw, each
of which the arm learns from.

What it is worth is told by tests at the same baskets before and after, from which nothing is
learned. The errors of the practised throws do not tell it: the coach sends these where throws are
worst.
"""

import argparse
import json
import shlex
import time
from functools import partial
from typing import TYPE_CHECKING, Any

from dart_skill.cli.names import CHANGES, PRACTICE_METHODS
from dart_skill.cli.run_options import (
    add_model,
    add_namespace,
    add_run,
    asked,
    check_model,
    check_run,
    parameter_texts,
)
from dart_skill.common.words import counted
from dart_skill.common.world import THROW, the_world
from dart_skill_nodes.process.graph_processes import Graph, GraphFailure
from dart_skill_nodes.verbs.on_graph import (
    PATIENCE,
    carried_out,
    on_running_graph,
    say,
    started,
)
from dart_skill_nodes.verbs.trials import practise, teach

if TYPE_CHECKING:
    import numpy as np
    from dart_skill_msgs.action import Practice

    from dart_skill.report import RunPhase
    from dart_skill.session import TrialResult
    from dart_skill_nodes.client.graph_client import GraphClient

OF_A_NEW_GRAPH = ("seed", "demonstrations", "output", "layout", "arm", "set", "method", "change", "change_after")  # fmt: skip
"""Options that are for a graph which the command starts."""
BLOCK = 5
"""Throws per line of the table."""
TESTS = 10
"""Baskets of a test where a simulator throws; a person with a real arm asks for tests."""
MODEL = "model.npz"
"""What was learned and found, beside the bag: practice goes on from it with --model."""
BEFORE, CHANGED, AFTER = "before practice", "after the change", "after practice"
"""When there is a test."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Practice over the real graph: a few demonstrations, then throw after throw, each of which"
        " the arm learns from. With --running on a graph that runs and has learned, as that of a"
        " real arm: a person is told when to put the ball into the hand."
    )
    add_run(parser, demonstrations=3, throws=20, thrown="own throws")
    parser.add_argument(
        "--method",
        choices=PRACTICE_METHODS,
        help="how to learn from own throws (default: of config/skill_learner.yaml)",
    )
    add_model(parser, "nothing is shown: practice goes on with the model of a file")
    tests = (
        "throws of a test before and one after, at baskets that stay the same; not learned from"
        f" (default {TESTS}, with --running 0)"
    )
    parser.add_argument("--tests", type=int, metavar="N", help=tests)
    parser.add_argument(
        "--change",
        choices=sorted(CHANGES),
        default="none",
        help="what happens to the arm, unannounced (default none)",
    )
    parser.add_argument(
        "--change-after",
        type=int,
        default=5,
        metavar="N",
        help="own throws before the change (default 5)",
    )
    running = parser.add_argument_group("on a graph that runs (dart-skill up)")
    running.add_argument(
        "--running",
        action="store_true",
        help="practise there: no graph is started, nothing is taught, no report is made",
    )
    add_namespace(running)
    where = running.add_mutually_exclusive_group()
    where.add_argument(
        "--at",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="centre of the rim [m] (default: as the cameras see it)",
    )
    where.add_argument(
        "--choose",
        action="store_true",
        help="the coach chooses where, throws at baskets where they are worst",
    )
    parser.add_argument(
        "--json", action="store_true", help="every throw as JSON on stdout instead of the table"
    )


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Practise; returns the exit status."""
    from dart_skill.report import PAGE

    check_model(parser, options)
    if options.tests is not None and options.tests < 0:
        parser.error(f"--tests is {options.tests}; it must be at least 0")
    if options.running:
        _refuse_what_starts_a_graph(options, parser)
        task = partial(practise_there, options=options)
        return on_running_graph(options, lambda client: client.is_simulated(PATIENCE), task)
    if options.at is not None or options.choose or options.namespace:
        parser.error("--at, --choose and --namespace are for a graph that runs: add --running")
    if options.model is not None and options.demonstrations != parser.get_default(
        "demonstrations"
    ):
        parser.error(
            "--demonstrations is for a skill that is shown: with --model nothing is shown"
        )
    check_run(parser, options)
    if (options.output / MODEL).exists():
        parser.error(f"--output {options.output} holds a model already: choose another folder")
    if options.model is not None:
        options.demonstrations = 0
    if options.change_after < 0:
        parser.error(f"--change-after is {options.change_after}; it must be at least 0")
    if options.change != "none" and options.change_after >= options.throws:
        parser.error(
            f"--change-after is {options.change_after}: there are {options.throws} throws only"
        )
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
        print(f"\nbag, summary.json, report.html and {MODEL}: {options.output}")
        print(f"next: dart-skill practice --model {shlex.quote(str(options.output / MODEL))}")
        print(
            f"or: open {shlex.quote(str(options.output / PAGE))} in a browser, or dart-skill view"
            f" {shlex.quote(summary['bag'])}"
        )
    return 0 if summary["thrown"] == options.throws else 1


def _refuse_what_starts_a_graph(
    options: argparse.Namespace, parser: argparse.ArgumentParser
) -> None:
    """A usage error for options that say something of a graph which is not started."""
    for name in OF_A_NEW_GRAPH:
        if getattr(options, name) != parser.get_default(name):
            parser.error(
                f"--{name.replace('_', '-')} is for a graph that is started: leave out --running,"
                " or this"
            )
    if options.throws < 1:
        parser.error(f"--throws is {options.throws}; it must be at least 1")


def practise_there(client: "GraphClient", options: argparse.Namespace) -> dict:
    """Own throws on a graph that runs, each of which is learned from, between two tests if they
    were asked for.
    """
    from dart_skill.skills.protocol import load_skill

    skill = load_skill(client.skill(PATIENCE))
    if options.model is not None:
        say(f"model {client.load(options.model)}: practice goes on with it")
    if skill.told_by != "landings":
        if options.at is not None or options.tests:
            name = "tests" if options.at is None else "at"
            raise ValueError(
                f"--{name} is for throws: the graph practises '{skill.name}', whose situations the"
                " coach draws"
            )
        # nobody carries bodies about beside a real arm unless they ask for it
        follow = skill.looks and not options.choose and not client.is_simulated(PATIENCE)
        result, made = practise(client, skill, options.throws, follow_basket=follow)
        trials = {"executed": int(result.executed), "trials": [one.to_json() for one in made]}
        return _told(result, result.message, "dart-skill execute", **trials)
    where = (
        {}
        if options.choose
        else {"follow_basket": True}
        if options.at is None
        else {"targets": [options.at]}
    )
    fixed = where if not options.choose else {"targets": _test_baskets(0, options.tests or 0)}
    tests = [_test(client, BEFORE, 0, options.tests, fixed)] if options.tests else []
    result, made = practise(client, skill, options.throws, **where)
    throws = [_as_row(one) for one in made]
    if tests and result.success:
        tests.append(_test(client, AFTER, len(throws), options.tests, fixed))
    text = "\n".join([result.message, *tests_table(tests)])
    thrown = {"thrown": int(result.executed), "throws": throws, "tests": tests}
    return _told(result, text, "dart-skill throw", **thrown)


def _told(result: "Practice.Result", text: str, then: str, **more: Any) -> dict:
    told = {"text": text, "learned": int(result.learned), **more}
    return {**told, "ok": bool(result.success), "next": then}


def _test_baskets(seed: int, count: int) -> "np.ndarray":
    """Baskets (n, 3) of all tests of a seed, spread over the region [m]."""
    import numpy as np

    from dart_skill.common.regions import REGION

    return REGION.spread(count, np.random.default_rng([seed, 6]))


def _test(client: "GraphClient", when: str, after: int, throws: int, where: dict) -> dict:
    """Throws from which nothing is learned. where: targets, or that they follow the basket; after:
    own throws practised before them.
    """
    from dart_skill.skills.protocol import load_skill

    world = the_world()
    free = 100.0 * (world.basket_radius - 0.5 * world.ball_diameter)
    say(
        f"test {when}: {counted(throws, 'throw')}, from which nothing is learned; farther than"
        f" {free:.1f} cm from the middle the ball meets the rim"
    )
    result, made = practise(
        client, load_skill(THROW), throws, "test throw", **where, only_throw=True
    )
    if len(made) < throws:
        raise GraphFailure(
            f"the test {when} ended after {len(made)} of {throws} throws: {result.message}"
        )
    return {"when": when, "after_throws": after, "throws": [_as_row(one) for one in made]}


def run(options: argparse.Namespace) -> dict:
    """The whole job on a graph of its own."""
    from dart_skill.session import error_quantile
    from dart_skill.simulation import CHANGES as VALUES
    from dart_skill.skills.protocol import load_skill

    if options.method:
        options.differs.setdefault("skill_learner", {})["practice_method"] = options.method
    with Graph(options.output / "logs") as graph:
        client = started(graph, options)
        if options.model is None:
            teach(client, options.seed, options.demonstrations)
            say(client.learn().message)
        else:
            say(f"model {client.load(options.model)}: nothing is shown")
        skill, results, throws = load_skill(THROW), [], []
        tests, count = [], TESTS if options.tests is None else options.tests
        test = partial(
            _test, client, throws=count, where={"targets": _test_baskets(options.seed, count)}
        )
        if count:
            tests.append(test(BEFORE, 0))
        begun = time.monotonic()
        blocks = (
            [options.throws]
            if options.change == "none"
            else [options.change_after, options.throws - options.change_after]
        )
        for block, wanted in enumerate(blocks):
            if block:
                client.set_parameters("wam_simulator", VALUES[options.change])
                say(f"from now on: {options.change}")
                tests += [test(CHANGED, options.change_after)] if count else []
            if wanted:
                result, made = practise(client, skill, wanted, before=len(throws))
                results.append(result)
                throws += made
        took = time.monotonic() - begun
        tests += [test(AFTER, options.throws)] if count else []
        client.save(options.output / MODEL)
        client.close()
    return {
        "skill": THROW,
        "tried": len(throws),
        "succeeded": sum(one.success for one in throws),
        "median_error_m": error_quantile(throws, 0.5),
        "trials": [one.to_json() for one in throws],
        "wall_seconds": round(took, 1),
        "seed": options.seed,
        "demonstrations": options.demonstrations,
        "thrown": sum(result.executed for result in results),
        "learned": sum(result.learned for result in results),
        "change": options.change,
        "change_after": options.change_after,
        "message": results[-1].message,
        "bag": str(options.output / "bag"),
        "throws": [_as_row(one) for one in throws],
        "tests": tests,
    }


def _as_row(one: "TrialResult") -> dict:
    """A throw as the summary has it."""
    return {
        "target_m": one.target.tolist(),
        "landing_m": None if one.landing is None else list(one.landing),
        "error_m": one.error_m,
        "in_basket": one.success,
        "message": one.message,
    }


def _result(row: dict) -> "TrialResult":
    """The throw of a row."""
    from dart_skill.session import TrialResult

    names = ("target_m", "landing_m", "error_m", "in_basket", "message")
    return TrialResult.of_throw(*(row[name] for name in names))


def table(summary: dict) -> str:
    """What practice is worth, by the tests; then the errors of the practised throws in blocks."""
    lines = tests_table(summary["tests"])
    lines += ["", "the practised throws, at baskets where a throw teaches most:"] if lines else []
    lines += [_HEAD.format("throws")]
    for first in range(0, len(summary["throws"]), BLOCK):
        block = summary["throws"][first : first + BLOCK]
        lines.append(_line(f"{first + 1}-{first + len(block)}", block))
    if not summary["tests"]:
        lines.append(
            "these baskets differ, and the coach looks for bad ones: what practice is worth is"
            " told by --tests N"
        )
    done = (
        f"{summary['thrown']} throws made, {summary['learned']} learned from, in"
        f" {summary['wall_seconds']:.0f} s"
    )
    return "\n".join([*lines, done])


def tests_table(tests: list[dict]) -> list[str]:
    """The tests line by line, and at how many of the baskets the last one was nearer than the one
    before; nothing without any.
    """
    if not tests:
        return []
    rows = [one["throws"] for one in tests]
    lines = [
        f"at the same {len(rows[0])} baskets, nothing is learned from these throws:",
        _HEAD.format(""),
    ]
    lines += [_line(one["when"], one["throws"]) for one in tests]
    errors = (
        [(first["error_m"], last["error_m"]) for first, last in zip(*rows[-2:], strict=True)]
        if len(rows) > 1
        else []
    )
    both = [(first, last) for first, last in errors if first is not None and last is not None]
    if both:
        nearer = sum(last < first for first, last in both)
        lines.append(
            f"nearer to the middle {tests[-1]['when']} than {tests[-2]['when']}: {nearer} of"
            f" {len(both)} baskets"
        )
    return lines


_HEAD = f"{{:>18}}{'in':>8}{'median [cm]':>14}{'worst [cm]':>13}"


def _line(name: str, throws: list[dict]) -> str:
    """Throws in a line of a table."""
    import numpy as np

    errors = 100 * np.array([row["error_m"] for row in throws if row["error_m"] is not None])
    numbers = (
        f"{np.median(errors):>14.2f}{errors.max():>13.2f}" if len(errors) else f"{'not seen':>14}"
    )
    inside = f"{sum(row['in_basket'] for row in throws)}/{len(throws)}"
    return f"{name:>18}{inside:>8}{numbers}"


def phases_of(summary: dict) -> "list[tuple[RunPhase, list[dict]]]":
    """What all throws of a run were for, in order of time, with their rows."""
    from dart_skill.report import RunPhase

    found, done = [], 0
    for test in summary["tests"]:
        if practised := summary["throws"][done : test["after_throws"]]:
            found.append((RunPhase("practised", len(practised), learned_from=True), practised))
        done = max(done, test["after_throws"])
        found.append((RunPhase(test["when"], len(test["throws"])), test["throws"]))
    if rest := summary["throws"][done:]:
        found.append((RunPhase("practised", len(rest), learned_from=True), rest))
    return found


def write_report(summary: dict, options: argparse.Namespace, asked_for: list[tuple]) -> None:
    """summary.json, and the page beside it."""
    from dart_skill.report import PAGE, About, read_run, write_page
    from dart_skill.session import write_summary

    write_summary(summary, options.output)
    changed = options.change != "none"
    begun = (
        f"{options.demonstrations} demonstrations"
        if options.model is None
        else f"the model {options.model.name}"
    )
    facts = {
        "Seed": str(options.seed),
        "Change": (
            f"{options.change}, after {options.change_after} own throws, unannounced"
            if changed
            else "none"
        ),
        "Learned from": f"{summary['learned']} of {summary['thrown']} own throws, besides {begun}",
        "Time": (
            f"{summary['wall_seconds']:.0f} s for the practised throws"
            + (" and a test" if changed and summary["tests"] else "")
        ),
    }
    marks = {options.change_after: options.change} if changed else {}
    title = f"Practice: {begun}, {summary['thrown']} own throws"
    phases = phases_of(summary)
    about = About(
        title,
        facts,
        asked_for,
        parameter_texts(),
        marks=marks,
        phases=tuple(phase for phase, _ in phases),
    )
    trials = [_result(row) for _, rows in phases for row in rows]
    write_page(read_run(summary["bag"], about, trials), options.output / PAGE)
