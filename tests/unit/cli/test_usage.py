"""The command line: usage errors, results on stdout."""

import json
import os
import subprocess
import sys

import pytest

from dart_skill.cli import _completion, _main, main

WITHOUT = """
import sys
sys.modules.update(dict.fromkeys({modules!r}))
from dart_skill.cli import main
sys.exit(main({arguments!r}))
"""


def run_without(modules, *arguments):
    """`dart-skill` where some modules cannot be imported, if the nodes are there."""
    pytest.importorskip("dart_skill_nodes")
    script = WITHOUT.format(modules=modules, arguments=list(arguments))
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)


@pytest.mark.parametrize(
    ("typed", "there_is"),
    [([], "practice"), (["bag"], "recover"), (["darts"], "heatmap"), (["experiment"], "figure")],
)
def test_where_a_command_is_missing_those_that_there_are_are_listed(typed, there_is, capsys):
    with pytest.raises(SystemExit) as end:
        main(typed)
    assert end.value.code == 2 and f"\n    {there_is} " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "meant"),
    [(["dem"], "demo"), (["bag", "inof"], "info"), (["experiment", "figur"], "figure")],
)
def test_what_is_misspelt_is_guessed(typed, meant, capsys):
    with pytest.raises(SystemExit) as end:
        main(typed)
    said = capsys.readouterr().err
    assert end.value.code == 2 and f"; did you mean '{meant}'?" in said


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["bag", "info", "somewhere", "--jsno"], "--json"),
        (["darts", "match", "--sigma=12", "--against=15", "--lges=3"], "--legs"),
    ],
)
def test_an_option_that_is_misspelt_is_guessed(typed, meant, capsys):
    with pytest.raises(SystemExit) as end:
        main(typed)
    said = capsys.readouterr().err
    assert end.value.code == 2 and f"; did you mean '{meant}'?" in said


def test_of_what_is_like_no_command_nothing_is_guessed(capsys):
    with pytest.raises(SystemExit):
        main(["nonsense"])
    assert "did you mean" not in capsys.readouterr().err


def test_an_unknown_option_is_told_with_the_usage_of_its_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["bag", "info", "somewhere", "--nope"])
    assert (
        end.value.code == 2
        and "dart-skill bag info: error: unrecognized arguments: --nope" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "command",
    ["throws --seeds", "basket --throws", "place --parts", "reach --cups", "practice --seeds"],
)
def test_an_experiment_without_a_run_is_refused(command, capsys):
    with pytest.raises(SystemExit) as end:
        main(["experiment", *command.split(), "0"])
    assert end.value.code == 2 and "0: give at least 1" in capsys.readouterr().err


def test_what_is_to_be_typed_next_can_be_copied(tmp_path, capsys):
    """A folder with a space in its name was printed as two words."""
    policy = tmp_path / "my policy.xml"
    assert main(["security", str(policy)]) == 0
    assert f"-p '{policy}'" in capsys.readouterr().out
    assert main(["security", str(tmp_path / "again.xml"), "--json"]) == 0
    assert "/dart_skill/commander" in json.loads(capsys.readouterr().out)["enclaves"]


def test_an_unknown_configuration_is_named_with_those_there_are(capsys):
    assert main(["experiment", "throws", "--configurations", "nonsense"]) == 1
    said = capsys.readouterr().err
    assert "nonsense" in said and "default" in said and "thesis" in said


@pytest.mark.slow
def test_the_throws_experiment_gives_one_row_per_throw_as_json(capfd):
    arguments = [
        "--seeds",
        "1",
        "--demonstrations",
        "4",
        "--throws",
        "2",
        "--configurations",
        "default,thesis",
        "--json",
    ]
    assert main(["experiment", "throws", *arguments]) == 0
    result = json.loads(capfd.readouterr().out)
    assert [row["configuration"] for row in result["summary"]] == ["default", "thesis"]
    assert len(result["throws"]) == 4
    for throw in result["throws"]:
        assert (throw["along"] is None) == (throw["across"] is None)
        assert throw["along"] is not None or throw["note"], (
            f"neither a landing nor a reason: {throw}"
        )


def test_the_ladder_stands_for_its_configurations(monkeypatch, capfd):
    asked = []
    monkeypatch.setattr(
        "dart_skill.experiments.studies.throws.run_seed",
        lambda seed, names, **_: asked.extend(names) or [],
    )
    assert (
        main(["experiment", "throws", "--seeds", "1", "--configurations", "default,ladder"]) == 0
    )
    assert asked[:3] == ["default", "thesis", "+release_clock"] and {
        "+farthest_release",
        "without_overlap",
    } < set(asked)
    assert capfd.readouterr().out.startswith("configuration ")


@pytest.mark.parametrize(
    "command",
    ["up", "demo", "practice", "teach", "throw", "execute", "learn", "bag play", "check arm"],
)
def test_help_and_usage_errors_need_no_ros(command):
    told = run_without(["rclpy"], *command.split(), "--help")
    assert (told.returncode, told.stderr) == (0, "")
    assert told.stdout.startswith(f"usage: dart-skill {command} ") and "--json" in told.stdout
    wrong = run_without(["rclpy"], *command.split(), "--no-such-option")
    assert wrong.returncode == 2 and "usage: dart-skill" in wrong.stderr


@pytest.mark.parametrize(
    ("arguments", "status"),
    [(["--help"], 0), (["up"], 1), (["teach", "--count", "2"], 1), (["bag", "play", "x"], 1)],
)
def test_without_the_nodes_it_is_said_what_is_missing(arguments, status):
    told = run_without(["dart_skill_nodes"], *arguments)
    assert told.returncode == status and "Traceback" not in told.stderr
    assert (
        status == 0
        or "needs the ROS 2 workspace: 'make setup', then 'source tools/env.sh'" in told.stderr
    )


def test_the_verbs_look_for_the_graph_where_up_starts_it():
    """On the user's ROS domain; `demo` and `practice` choose one that is free, for a graph of
    their own, when they begin.
    """
    pytest.importorskip("rclpy")
    verbs = ", ".join(
        f"dart_skill_nodes.verbs.{name}"
        for name in ("up", "teach", "learn", "throw", "demo", "practice")
    )
    script = f"import os, {verbs}; print(os.environ.get('ROS_DOMAIN_ID'))"
    environment = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True
    )
    assert told.stdout.splitlines()[-1] == "None"


@pytest.mark.slow
def test_arms_of_the_throws_experiment_are_names_or_the_fleet(capfd):
    arguments = [
        "--arms",
        "fleet",
        "--first-seed",
        "5",
        "--seeds",
        "1",
        "--demonstrations",
        "3",
        "--throws",
        "1",
        "--json",
    ]
    assert main(["experiment", "throws", *arguments]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["thrown"] == 1 and {"in", "median_error_m", "p90_error_m"} <= set(told)
    assert [throw["arm"] for throw in told["throws"]] == ["fleet:5"]
    assert main(["experiment", "throws", "--arms", "nobody", "--seeds", "1"]) == 1
    assert "no arm 'nobody'" in capfd.readouterr().err
    assert main(["experiment", "throws", "--set", "skill.components=8", "--seeds", "1"]) == 1
    assert "--set skill.NAME is for a demo or a graph" in capfd.readouterr().err


@pytest.mark.parametrize(("asked", "shown"), [((), 8), (("--demonstrations", "13"), 13)])
def test_a_demo_of_a_skill_shows_as_many_as_were_asked_for(monkeypatch, tmp_path, asked, shown):
    """Also if that is what a demo of throws shows."""
    jobs = []

    def begun(job, *_):
        jobs.append(job)
        raise ValueError("seen enough")

    monkeypatch.setattr("dart_skill.session.demo", begun)
    words = ["--layout", "in-process", "--output", str(tmp_path / "run"), *asked]
    assert main(["demo", "--skill", "place", *words]) == 1
    assert [job.demonstrations for job in jobs] == [shown]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--arm", "nobody"], "no arm 'nobody': choose fleet:SEED"),
        (["--set", "mock_optitrack.nose=1"], "mock_optitrack has no parameter nose"),
        (["--set", "nobody.noise=1"], "there is no node nobody"),
        (["--set", "mock_optitrack.noise=much"], "'much' is no float, which noise is"),
        (["--set", "noise"], "give NODE.PARAMETER=VALUE"),
        (["--set", "skill.compnents=8"], "compnents is no setting"),
        (["--set", "skill.components"], "give skill.NAME=VALUE"),
        (["--set", "skill.practice=luck"], "no practice 'luck' for the skill 'throw'"),
    ],
)
def test_arms_and_parameters_that_do_not_exist_are_usage_errors(capsys, arguments, message):
    pytest.importorskip("dart_skill_nodes")
    for verb in ("demo", "practice", "up"):
        with pytest.raises(SystemExit) as end:
            main([verb, *arguments])
        assert end.value.code == 2 and message in capsys.readouterr().err


def test_what_a_check_of_the_arm_cannot_do_is_a_usage_error_before_it_listens(capsys, tmp_path):
    pytest.importorskip("dart_skill_nodes")
    file = tmp_path / "registration.yaml"
    file.write_text("mine")
    wrong = {
        ("--write", str(file)): "exists already",
        ("--write", str(tmp_path / "nowhere" / "a.yaml")): "there is no folder",
        ("--postures", "0"): "at least 1",
        ("--duration", "nan"): "positive and finite",
    }
    for arguments, message in wrong.items():
        with pytest.raises(SystemExit) as end:
            main(["check", "arm", *arguments])
        assert end.value.code == 2 and message in capsys.readouterr().err
    assert file.read_text() == "mine"


def test_an_arm_and_a_parameter_reach_the_processes_that_run_their_nodes():
    pytest.importorskip("dart_skill_nodes")
    from dart_skill_nodes.process.graph_processes import of_executables

    differs = {
        "mock_optitrack": {"noise": 0.001},
        "skill_learner": {"practice_method": "none"},
        "teacher": {"speed": 0.0},
    }
    assert of_executables("composed", differs) == {
        "composed": {"mock_optitrack:noise": 0.001, "teacher:speed": 0.0},
        "skill_learner": {"practice_method": "none"},
    }


@pytest.mark.parametrize(
    "words",
    (
        "experiment figure 5.1",
        "experiment darts",
        "darts heatmap --sigma 20",
        "darts aim --sigma 20",
        "demo",
    ),
)
def test_a_folder_that_is_filled_is_not_called_like_a_file(words, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*words.split(), "--output", "x.png"])
    assert ended.value.code == 2
    assert (
        "x.png: what is written fills a folder; this is the name of a file"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize("words", ("practice", "up", "experiment soak", "experiment faults"))
def test_neither_is_that_of_a_verb_of_the_graph(words, capsys):
    pytest.importorskip("dart_skill_nodes")
    test_a_folder_that_is_filled_is_not_called_like_a_file(words, capsys)


@pytest.mark.parametrize("bench", ("faults", "soak"))
def test_a_bench_needs_a_checkout(bench, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("dart_skill.cli.graph_verbs.CHECKOUT", tmp_path)
    assert main(["experiment", bench, "--no-matter-what"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"experiment {bench} needs a checkout" in line and f"tests/benches/{bench}" in line


def test_a_command_is_known_alone_as_it_is_known_among_all():
    """Only the parser of the command that is asked for is made: the others took a third of the
    time of a short one.
    """
    among_all = _completion.verbs_of(_main._parser())
    assert tuple(among_all) == _main.COMMANDS
    for name in _main.COMMANDS:
        alone = _main._parser([name, "something"])
        assert list(_completion.verbs_of(alone)) == [name]
        for one, other in zip(
            _completion.commands_of(alone),
            [alone, *_completion.commands_of(among_all[name])],
            strict=True,
        ):
            assert one is alone or one.format_help() == other.format_help()
    for words in ([], ["--version"], ["nonsense"]):
        assert tuple(_completion.verbs_of(_main._parser(words))) == _main.COMMANDS


@pytest.mark.parametrize(("arguments", "how"), [("", "seldom"), ("['--help']", "as before")])
def test_a_command_seldom_looks_for_garbage_and_who_calls_it_as_often_as_before(arguments, how):
    script = f"""
import gc, sys
from dart_skill.cli import main
before = gc.get_threshold()
sys.argv = ["dart-skill", "--help"]
try:
    main({arguments})
except SystemExit:
    pass
print("as before" if gc.get_threshold() == before else "seldom" if gc.get_threshold()[0] > before[0] else "more often")
"""
    assert (
        subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True
        ).stdout.splitlines()[-1]
        == how
    )
