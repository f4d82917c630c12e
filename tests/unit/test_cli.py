"""The command line: usage errors, results on stdout."""

import json

import pytest

from dart_skill.cli import main


def test_no_command_is_a_usage_error(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 2


def test_an_unknown_configuration_is_named_with_those_there_are(capsys):
    assert main(["experiment", "throws", "--configurations", "nonsense"]) == 1
    said = capsys.readouterr().err
    assert "nonsense" in said and "default" in said and "thesis" in said


def test_the_throws_experiment_gives_one_row_per_throw_as_json(capfd):
    arguments = ["--seeds", "1", "--demonstrations", "4", "--throws", "2", "--configurations", "default,thesis", "--json"]
    assert main(["experiment", "throws", *arguments]) == 0
    result = json.loads(capfd.readouterr().out)
    assert [row["configuration"] for row in result["summary"]] == ["default", "thesis"]
    assert len(result["throws"]) == 4
    for throw in result["throws"]:
        assert (throw["along"] is None) == (throw["across"] is None)
        assert throw["along"] is not None or throw["note"], f"neither a landing nor a reason: {throw}"
