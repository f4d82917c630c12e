"""The command line `dart-skill`: nouns and verbs; results on stdout, progress on stderr; exit status 0, 1 (failed) or 2 (usage)."""

import argparse
import importlib
import json
import os
import runpy
import sys
from collections.abc import Callable

from dart_skill import completion

OVER_THE_GRAPH = {
    "up": "dart_skill_nodes.up",
    "demo": "dart_skill_nodes.demo",
    "practice": "dart_skill_nodes.practice",
    "bag play": "dart_skill_nodes.play",
    **dict.fromkeys(("teach", "throw", "learn"), "dart_skill_nodes.verbs"),
}
"""Commands that need the ROS 2 workspace, and the modules that run them."""
TAB = "With TAB, bash and zsh complete commands, options and values: source tools/env.sh, or tools/completion.bash (.zsh) alone."


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    if completion.is_asked():
        return completion.answer(_parser(completion.words()))
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments and arguments[0] in OVER_THE_GRAPH and arguments[0] != "learn":
        if _options_of(arguments[0]):  # help and usage errors need no ROS
            _parser(arguments).parse_args(arguments)
        return _over_the_graph(arguments[0], arguments[1:])
    options = _parser(arguments).parse_args(arguments)
    if arguments[:2] == ["bag", "play"]:
        return _over_the_graph("bag play", arguments[2:])
    if arguments[0] == "learn" and options.bag is None:
        return _over_the_graph("learn", arguments[1:])
    try:
        status = options.run(options)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # `dart-skill ... | head`: nobody reads on, and the interpreter would complain about it at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, OSError, ImportError) as error:
        print(f"dart-skill: {error}", file=sys.stderr)
        return 1


def _parser(arguments: list[str]) -> argparse.ArgumentParser:
    """The parser of a command line. Parsers are cheap, and so are the modules they stand in; but those of `darts` bring SciPy along."""
    from dart_skill.recording.bag_command import add_bag
    from dart_skill.report.report_command import add_report
    from dart_skill.skill.learn_command import add_learn
    from dart_skill.view.rerun_command import add_view

    parser = argparse.ArgumentParser(prog="dart-skill", description="A robot arm that learns to throw from demonstrations.", epilog=TAB)
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    _add_graph_command(commands, "up", "start the node graph, watch it, and end it with Ctrl-C")
    _add_graph_command(commands, "demo", "the main job over real nodes: teach, learn, throw")
    _add_graph_command(commands, "practice", "own throws over real nodes, each of which is learned from")
    _add_graph_command(commands, "teach", "throws that a person guides, on a graph that runs")
    add_learn(commands)
    _add_graph_command(commands, "throw", "throws of the arm, on a graph that runs")
    add_bag(commands)
    add_view(commands)
    add_report(commands)
    _add_experiments(commands)
    _add_darts(commands, wanted=arguments[:1] == ["darts"])
    return parser


def _add_graph_command(commands, name: str, text: str) -> None:
    """A command that the nodes run; its options are known where they are installed."""
    parser = commands.add_parser(name, help=text)
    add_options = _options_of(name)
    if add_options:
        add_options(parser)


def _options_of(command: str) -> Callable[[argparse.ArgumentParser], None] | None:
    """What gives a command that the nodes run its options, without ROS; None where they are not installed."""
    try:
        return importlib.import_module("dart_skill_nodes.command_lines").OPTIONS[command]
    except ImportError:
        return None


def _add_experiments(commands) -> None:
    from dart_skill.experiments.basket_command import add_basket
    from dart_skill.experiments.darts_command import add_arm_darts
    from dart_skill.experiments.practice_command import add_practice
    from dart_skill.experiments.search_command import add_landscapes

    text = "repeat what the documentation quotes"
    experiments = commands.add_parser("experiment", help=text).add_subparsers(required=True, metavar="EXPERIMENT")
    _add_throws(experiments)
    add_basket(experiments)
    add_practice(experiments)
    add_arm_darts(experiments)
    _add_repeatability(experiments)
    add_landscapes(experiments)
    _add_figure(experiments)


def _add_throws(experiments) -> None:
    throws = experiments.add_parser("throws", help="the main job for several seeds, in process, as a table")
    throws.add_argument("--seeds", type=int, default=10, help="seeds 0 to N - 1 (default 10)")
    throws.add_argument("--configurations", default="default", help="names separated by commas (default: default)")
    throws.add_argument("--demonstrations", type=int, default=13)
    throws.add_argument("--throws", type=int, default=10, help="new baskets per seed (default 10)")
    throws.add_argument("--jobs", type=int, default=1, help="processes at a time (default 1)")
    throws.add_argument("--json", action="store_true", help="every throw as JSON instead of the table")
    throws.set_defaults(run=_experiment_throws)


def _add_repeatability(experiments) -> None:
    again = experiments.add_parser("repeatability", help="one plan thrown again and again: the floor of the error")
    again.add_argument("--seed", type=int, default=0)
    again.add_argument("--throws", type=int, default=25, help="of each plan (default 25)")
    again.add_argument("--json", action="store_true", help="JSON instead of the table")
    again.set_defaults(run=_experiment_repeatability)


def _add_figure(experiments) -> None:
    figure = experiments.add_parser("figure", help="a figure of the thesis, computed anew")
    figure.add_argument("number", help="3.1, 7.1, ..., regrets; 'list' says which there are, 'all' draws every one")
    figure.add_argument("--output", default="figures", metavar="FOLDER", help="where SVG and PNG go (default: figures)")
    figure.add_argument("--seed", type=int, default=0)
    figure.add_argument("--json", action="store_true", help="seed, paths and what was measured as JSON")
    figure.set_defaults(run=_experiment_figure)


def _add_darts(commands, wanted: bool) -> None:
    if not wanted:
        commands.add_parser("darts", help="where to aim on a dart board, for a thrower's spread or from scores")
        return
    from dart_skill.darts.command_line import add_commands
    from dart_skill.experiments.search_command import add_search

    add_search(add_commands(commands))


def _over_the_graph(command: str, arguments: list[str]) -> int:
    """Run a command of the nodes in this interpreter: the library itself knows no ROS."""
    verb = [command] if OVER_THE_GRAPH[command].endswith(".verbs") else []
    sys.argv = [f"dart-skill {command}", *verb, *arguments]
    try:
        runpy.run_module(OVER_THE_GRAPH[command], run_name="__main__")
    except ImportError as error:
        print(f"dart-skill {command} needs the ROS 2 workspace: 'make setup', then 'source tools/env.sh' ({error})", file=sys.stderr)
        return 1
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    return 0


def _experiment_throws(options: argparse.Namespace) -> int:
    from dataclasses import asdict

    from dart_skill.experiments import throws
    from dart_skill.skill.configuration import configuration

    names = tuple(configuration(name).name for name in options.configurations.split(","))
    seeds = list(range(options.seeds))
    results = throws.run(seeds, names, options.jobs, options.demonstrations, options.throws)
    if options.json:
        rows = [{k: None if v != v else v for k, v in asdict(result).items()} for result in results]
        print(json.dumps({"summary": throws.summarise(results), "throws": rows}, indent=1))
    else:
        print(throws.table(results))
    return 0


def _experiment_repeatability(options: argparse.Namespace) -> int:
    from dart_skill.experiments import throws

    rows = throws.repeatability(options.seed, [1.6, 2.0, 2.4], options.throws)
    print(json.dumps(rows, indent=1) if options.json else throws.repeatability_table(rows))
    return 0


def _experiment_figure(options: argparse.Namespace) -> int:
    from dart_skill.experiments import thesis

    if options.number == "list":
        titles = thesis.titles()
        print(json.dumps(titles, indent=1) if options.json else "\n".join(f"{number}  {title}" for number, title in titles.items()))
        return 0
    drawn = {}
    for number in thesis.FIGURES if options.number == "all" else [options.number]:
        paths, measured = thesis.draw(number, options.output, options.seed)
        drawn[number] = {"seed": options.seed, "paths": [str(path) for path in paths], "measured": measured}
        if not options.json:
            text = thesis.describe(number, measured).replace("\n", "\n  ")
            print(f"figure {number}, seed {options.seed}: {paths[0]}, {paths[1].name}\n  {text}")
    if options.json:
        print(json.dumps(drawn, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
