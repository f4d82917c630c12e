"""The page of a run: one file that asks nobody for anything, the same bytes for the same bag, and
everything that was thrown on it.
"""

import json
import platform
import re
from dataclasses import replace
from functools import lru_cache
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from dart_skill.cli import main
from dart_skill.cli.report import page_beside
from dart_skill.common.situation import Pose, Situation
from dart_skill.darts import LegInPlay
from dart_skill.figures import arm_darts_figure
from dart_skill.recording import BagWriter, GraphBag, read_command
from dart_skill.report import (
    CURVE_WINDOW,
    About,
    Movement,
    Replay,
    Run,
    RunPhase,
    compared_figure,
    curve_figure,
    embeddable,
    gaussians_of,
    machine,
    movements_of,
    numbers_of,
    page_of,
    pictures,
    play,
    read_run,
    result_of,
    rows_at,
    running_quartiles,
    versions,
    write_page,
)
from dart_skill.session import Dart, DartsRun, LegSummary, TrialResult
from dart_skill.skills.learning import component_ellipsoids
from dart_skill.skills.protocol import TaskOutcome, load_skill
from dart_skill.view import ViewUnavailable
from tests.paths import BAGS
from tests.unit.skills.task_demonstrations import draw_body, show

ABOUT = About(
    "<b>Title</b>", {"Seed": "7"}, [("seed", 7, 0), ("throws", 20, 20)], {"a.yaml": "x: 1 < 2\n"}
)
DRAWN = ["curve", "landings", "gaussians", "execution"]
ADDRESSES = ("src", "href", "xlink:href", "action", "data", "poster", "srcset")


@lru_cache
def run_of(name):
    return read_run(BAGS / name, ABOUT)


@lru_cache
def drawn_of(name):
    return pictures(run_of(name))


@lru_cache
def page_text(name):
    pytest.importorskip("viser")
    return page_of(run_of(name), drawn_of(name))


class Document(HTMLParser):
    """What a page fetches, and the texts of its cells."""

    def __init__(self, text):
        super().__init__()
        self.fetched, self.frames, self.ids, self.cells, self.policy, self._in = (
            [],
            [],
            [],
            [],
            "",
            "",
        )
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self._in = tag
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.fetched += [attributes[name] for name in ADDRESSES if attributes.get(name)]
        self.fetched += re.findall(
            r"url\(([^)]*)\)", attributes.get("style", "") + attributes.get("clip-path", "")
        )
        self.frames += [attributes["srcdoc"]] if "srcdoc" in attributes else []
        if attributes.get("http-equiv") == "Content-Security-Policy":
            self.policy = attributes["content"]

    def handle_data(self, data):
        if self._in == "td":
            self.cells.append(data.strip())
        if self._in == "style":
            self.fetched += re.findall(r"url\(([^)]*)\)|@import", data)


def test_nothing_is_fetched_from_outside():
    page = Document(page_text("throws"))
    assert len(page.frames) == 1, "the replay stands in the page itself"
    fetched = page.fetched + Document(page.frames[0]).fetched
    assert (
        fetched and [where for where in fetched if not re.match(r"['\"]?(#|data:)", where)] == []
    )
    assert "default-src 'none'" in page.policy and "http" not in page.policy


def test_the_same_run_gives_the_same_bytes():
    run = run_of("throws")
    assert page_of(run, pictures(run)) == page_text("throws")


def test_every_throw_is_on_the_page_with_target_landing_error_and_result():
    run, cells = run_of("throws"), Document(page_text("throws")).cells
    assert len(run.trials) == 20 and len(run.shown) == 13
    for throw in run.trials:
        row = [f"{throw.target[0]:.3f}", f"{throw.landing[0]:.3f}", f"{100 * throw.error_m:.1f}"]
        assert all(number.replace("-", "\N{MINUS SIGN}") in cells for number in row), row


def test_what_was_run_is_told_and_escaped():
    text = page_text("throws")
    assert "<h1>&lt;b&gt;Title&lt;/b&gt;</h1>" in text and "<b>Title" not in text
    assert "--seed 7 (default 0)" in text and "--throws" not in text
    assert "x: 1 &lt; 2" in text and "wam_simulator.yaml" in text
    for package, version in versions().items():
        assert f"{package} {version}" in text
    assert run_of("throws").throws.learned.model_id in text


def test_the_machine_is_told_without_its_name():
    assert platform.machine() in machine() and "cores" in machine()
    if len(platform.node()) > 4:
        assert platform.node() not in machine() and platform.node() not in page_text("throws")


@pytest.mark.slow
def test_each_picture_is_an_element_whose_ids_are_its_own():
    elements = [form for picture in drawn_of("throws") for form in picture.forms.values()]
    assert [picture.name for picture in drawn_of("throws") if picture.svg] == DRAWN
    ids = [set(re.findall(r'\bid="([^"]+)"', element)) for element in elements]
    assert sum(map(len, ids)) == len(set.union(*ids))
    for element, own in zip(elements, ids, strict=True):
        ElementTree.fromstring(element)
        used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', element))
        assert used and used <= own
        assert "<text" in element and "<metadata>" not in element and "sans-serif" in element


def test_a_narrow_screen_gets_figures_of_its_own_whose_letters_it_can_read():
    for picture in drawn_of("throws"):
        for kind, form in picture.forms.items():
            width = float(re.search(r'viewBox="0 0 ([\d.]+)', form).group(1))
            assert (width < 340) == (kind == "narrow"), (
                f"{picture.name}, {kind}: {width} points; a telephone has about 330 pixels"
            )
            assert f'<div class="{kind}"><svg' in picture.element
    assert "@media (prefers-color-scheme: dark)" in page_text(
        "throws"
    ) and "figure .narrow { display: block; }" in page_text("throws")


# practice


PHASES = (
    RunPhase("before practice", 5),
    RunPhase("practised", 10, True),
    RunPhase("after practice", 5),
)


def practised_run():
    """The throws of the bag as if the arm had learned from the ten in the middle."""
    run = run_of("throws")
    return replace(run, about=replace(run.about, phases=PHASES))


def test_practice_is_judged_by_its_tests_and_not_by_the_throws_that_were_learned_from(monkeypatch):
    monkeypatch.setattr("dart_skill.report._page._replay", lambda run: (None, "not now"))
    run = practised_run()
    assert run.practised == run.trials[5:15] and [results for _, results in run.tests] == [
        run.trials[:5],
        run.trials[15:],
    ]
    drawn = pictures(run)
    assert [picture.name for picture in drawn[:3]] == ["tests", "curve", "landings"]
    assert "does not tell whether practice helps" in drawn[1].caption.replace(
        "this curve alone ", ""
    )
    text = page_of(run, drawn)
    for name, throws in (
        ("before practice", run.trials[:5]),
        ("after practice", run.trials[15:]),
    ):
        median = 100 * np.median([throw.error_m for throw in throws])
        assert (
            f"<b>{median:.2f} cm</b><span>{name}: median landing error at 5 fixed baskets" in text
        )
    assert "own throws in the basket" not in text, (
        "one number of throws of three purposes says nothing"
    )
    assert [text.count(f"<td>{phase.name}</td>") for phase in PHASES] == [
        5,
        10,
        5,
    ], "the purpose of each throw"


def test_a_learning_curve_is_shown_only_where_something_was_learned():
    titles = {picture.name: picture.title for picture in drawn_of("throws")}
    assert titles[
        "curve"
    ] == "Landing error, throw by throw" and "Learning curve" not in page_text("throws")
    labels = [
        text.get_text() for text in curve_figure(run_of("throws").trials).legends[0].get_texts()
    ]
    assert labels == [
        "quartiles",
        "median",
        "in",
    ], "no running median of throws whose order means nothing"
    learned = [
        text.get_text()
        for text in curve_figure(run_of("throws").trials, learned=True).legends[0].get_texts()
    ]
    assert f"median of the last {CURVE_WINDOW} throws" in learned


def test_phases_that_are_not_all_throws_are_an_error():
    with pytest.raises(ValueError, match="must add up to all throws"):
        read_run(BAGS / "throws", About(phases=PHASES[:2]), run_of("throws").trials)


def test_tests_are_compared_basket_by_basket():
    before, after = run_of("throws").trials[:5], run_of("throws").trials[15:]
    axes = compared_figure([("before", before), ("after", after)]).axes
    assert [text.get_text() for text in axes[0].get_xticklabels()] == ["before", "after"]
    medians = [
        f"{100 * np.median([throw.error_m for throw in throws]):.2f}" for throws in (before, after)
    ]
    assert [text.get_text() for text in axes[0].texts] == medians
    assert len(axes[1].texts) == 5, "an arrow for each basket"
    for wrong in ([("before", before)], [("before", before), ("after", after[:3])]):
        with pytest.raises(ValueError, match="two or more with the same number"):
            compared_figure(wrong)


# the replay


class Stage:
    """Stands for a scene and its timeline: remembers where the ball was when something was told."""

    def __init__(self):
        self.ball, self.ways, self.told = [], [], []

    def move_ball(self, position):
        self.ball.append(position)

    def extend_path(self, name, points):
        self.ways.append((name, len(self.ball)))

    def tell(self, text):
        self.told.append((len(self.ball), text))

    def __getattr__(self, name):
        return lambda *_: None


def played(movement):
    """A stage on which a movement of the throws was shown."""
    stage, run = Stage(), run_of("throws")
    seconds = play(stage, stage, run, movement, tell=stage.tell)
    assert seconds == pytest.approx(len(stage.ball) * 0.04 + 0.6, abs=0.2)
    return stage


@pytest.mark.parametrize("number", range(3))
def test_what_became_of_a_throw_is_told_when_the_ball_is_down(number):
    throw = run_of("throws").own[number]
    stage = played(throw)
    (at_first, name), (down, result) = stage.told
    assert (at_first, name) == (0, throw.name) and result.startswith(f"{throw.name}: in, ")
    assert result.endswith(f"{100 * throw.result.error_m:.1f} cm from the middle")
    heights, rim = np.array(stage.ball)[:, 2], throw.result.target[2]
    assert heights[:down].min() > rim, "not while it flies"
    assert heights[down] < rim + 0.06, "in the picture in which it passes the rim, or 10 ms later"
    ways = {name for name, _ in stage.ways}
    assert ways == {"ball", "hand"} and min(at for _, at in stage.ways) > 5, "not from the start"


def test_a_throw_whose_landing_was_not_seen_is_told_when_all_is_over():
    throw = run_of("throws").own[0]
    stage = played(replace(throw, known=throw.until))
    assert [at for at, _ in stage.told] == [0, len(stage.ball)]


def test_a_movement_that_is_long_is_shown_from_its_end():
    """A sample stands for an instant shortly after it only, and none where there are none."""
    throw = run_of("throws").own[0]
    stage = Stage()
    seconds = play(
        stage, stage, run_of("throws"), replace(throw, since=throw.since - 60_000_000_000)
    )
    assert seconds == pytest.approx(12.6)
    stamps, instants = np.array([0, 10_000_000]), np.array([-1, 5_000_000, 59_000_000, 70_000_000])
    np.testing.assert_array_equal(rows_at(stamps, instants), [-1, 0, 1, -1])
    np.testing.assert_array_equal(rows_at(stamps[:0], instants), [-1] * 4)


def test_each_throw_is_shown_with_the_gaussians_for_its_own_basket():
    run = run_of("throws")
    assert [one.name for one in run.own[:2]] == ["throw 1", "throw 2"]
    for throw in run.own[:2]:
        wanted = component_ellipsoids(run.throws.learned.mixture(throw.result.target))
        for one, other in zip(gaussians_of(run, throw), wanted, strict=True):
            for value, expected in zip(one, other, strict=True):
                np.testing.assert_array_equal(value, expected)
    assert gaussians_of(replace(run, throws=replace(run.throws, learned=None)), throw) == ()


def test_an_element_keeps_what_it_draws():
    svg = (
        '<?xml version="1.0"?><!DOCTYPE svg><svg><metadata>x</metadata><g id="a"/><use'
        ' xlink:href="#a"/><g clip-path="url(#a)"/></svg>'
    )
    assert (
        embeddable(svg, "p")
        == '<svg><g id="p-a"/><use xlink:href="#p-a"/><g clip-path="url(#p-a)"/></svg>'
    )


def test_a_bag_of_guided_throws_shows_these_and_says_what_it_has_not():
    run, text = run_of("demonstrations"), page_text("demonstrations")
    assert not run.own and len(run.shown) == 13 == sum(one.result.success for one in run.guided)
    missing = {
        picture.name: picture.caption for picture in drawn_of("demonstrations") if not picture.svg
    }
    assert set(missing) == {"curve", "landings", "execution"} and all(
        text.startswith("Not drawn: ") for text in missing.values()
    )
    assert "All 13 guided throws" in text and "The arm made no throws of its own." in text
    assert all(one.name in text for one in run.guided) and len(run.guided) == 13


def test_without_viser_the_page_says_what_to_install(monkeypatch):
    def missing():
        raise ViewUnavailable("no viser")

    monkeypatch.setattr("dart_skill.view._server.load_viser", missing)
    text = page_of(run_of("throws"), drawn_of("throws"))
    assert (
        "<iframe" not in text
        and "pip install &#x27;dart_skill[view]" in text
        and len(text) > 100_000
    )


def test_throws_that_never_came_about_have_a_row_and_no_place_in_the_replay():
    run = run_of("throws")
    refused = TrialResult.of_throw((2.0, 0.0, 0.4), None, None, False, "refused: out of reach")
    results = (refused, *run.trials[:2], refused, *run.trials[2:])
    found = [throw for throw in run.throws.found if not throw.taught]
    assert numbers_of(found, results) == [2, 3, *range(5, 23)]
    assert numbers_of(found, results[:3]) == [2, 3, *[0] * 18]


def test_commands_are_read_once_and_their_stamps_are_those_of_the_bag():
    with GraphBag(BAGS / "throws") as bag:
        stamps = [
            read_command(one.data)[0] for one in bag.messages(["/wam/command"], decode=False)
        ]
    np.testing.assert_array_equal(run_of("throws").throws.command_stamps, np.unique(stamps))
    assert len(stamps) > 10_000


def test_results_of_the_bag_are_those_of_the_cameras():
    run = run_of("throws")
    found = [result_of(throw) for throw in run.throws.found if not throw.taught]
    assert [one.to_json_of_throw() for one in found] == [
        one.to_json_of_throw() for one in run.trials
    ]
    errors = [
        np.linalg.norm(np.subtract(throw.landing[:2], throw.target[:2])) for throw in run.trials
    ]
    np.testing.assert_allclose(errors, [throw.error_m for throw in run.trials], atol=1e-3)


def test_running_quartiles_are_those_of_the_last_throws_that_were_seen():
    errors = np.array([1.0, 2.0, np.nan, 4.0, 8.0, 16.0, np.nan, np.nan, np.nan, np.nan, np.nan])
    result = running_quartiles(errors)
    assert np.isnan(result[:, : CURVE_WINDOW - 1]).all() and np.isnan(result[:, -1]).all()
    for end in range(CURVE_WINDOW, len(errors)):
        seen = [error for error in errors[end - CURVE_WINDOW : end] if error == error]
        np.testing.assert_allclose(result[:, end - 1], np.percentile(seen, [25, 50, 75]))
    assert running_quartiles(errors[:3]).shape == (3, 3)


def test_a_curve_needs_a_landing_and_marks_what_happened():
    unseen = TrialResult.of_throw((2.0, 0.0, 0.4), None, None, False)
    with pytest.raises(ValueError, match="no landing was seen"):
        curve_figure([unseen])
    axes = curve_figure([unseen, *run_of("throws").trials], marks={5: "base_turned"}).axes[0]
    assert "base turned" in [
        text.get_text() for text in axes.texts
    ] and "n = 21 throws, 20 landings seen" in axes.get_title(loc="left")


# files and command line


def test_figures_are_written_beside_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr("dart_skill.report._page._replay", lambda run: (None, "not now"))
    folder = tmp_path / "new"
    written = write_page(replace(run_of("throws"), trials=()), folder / "page.html", folder)
    assert {path.name for path in written} == {
        "page.html",
        "gaussians.svg",
        "gaussians.png",
    } and all(path.is_file() for path in written)


def test_a_bag_that_cannot_be_read_leaves_nothing_behind(tmp_path, capsys):
    with BagWriter(tmp_path / "bag"):
        pass
    assert main(["report", str(tmp_path / "bag")]) == 1
    assert "no topic" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "missing")]) == 1
    assert "no such bag" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_an_existing_page_is_not_overwritten(tmp_path, capsys):
    page = tmp_path / "page.html"
    page.write_text("mine")
    assert main(["report", str(BAGS / "throws"), "--output", str(page)]) == 1
    assert "exists already" in capsys.readouterr().err and page.read_text() == "mine"


def test_an_unknown_configuration_is_told_before_anything_is_read(tmp_path, capsys):
    assert main(["report", str(tmp_path), "--configuration", "nonsense"]) == 1
    assert "nonsense" in capsys.readouterr().err


@pytest.mark.parametrize("at_rest", [1.0, 3.0])
def test_what_a_world_does_while_nobody_asks_for_anything_is_no_trial(at_rest):
    """A graph rests after half a second of its own time; that stretch counted as one of the arm's,
    and no trial was matched.
    """
    since = (1.0, 3.0, 6.0)  # [s]
    stamps = np.concatenate(
        [begin + np.arange(0.0, 0.6 if begin == at_rest else 1.5, 0.02) for begin in since]
    )
    places = np.random.default_rng(0).normal(scale=3e-4, size=(len(stamps), 7)) + [
        1.2,
        0.0,
        1.5,
        0.0,
        0.0,
        0.0,
        1.0,
    ]
    moves = (stamps < at_rest) | (stamps > at_rest + 1.8)
    places[moves, 0] += 0.3 * (stamps[moves] % 3.0)
    hand = (np.round(1e9 * stamps).astype(np.int64), places)
    trials = [
        TrialResult(Situation({}), TaskOutcome(True, 0.001)),
        TrialResult(Situation({}), TaskOutcome(False, 0.03)),
    ]
    movements, notes = movements_of(hand, np.empty(0, dtype=np.int64), [], trials, [])
    assert notes == () and [one.name for one in movements] == ["trial 1", "trial 2"]
    assert [one.result for one in movements] == trials


NOTHING = (np.empty(0, dtype=np.int64), np.empty((0, 7)))
DONE = TrialResult(
    Situation({"holder": Pose(np.array([0.6, 0.1, 1.2]))}), TaskOutcome(True, 0.001)
)
JAMMED = TrialResult(DONE.situation, TaskOutcome(False, 0.03, "it <jammed>"))


def run_of_skill(name, trials, movements=(), **changes):
    run = Run(Path("bag"), About(name), load_skill(name), (), {}, NOTHING, movements, trials)
    return replace(run, **changes)


def test_the_page_of_another_skill_tells_its_trials_in_its_unit(monkeypatch):
    own = [Movement(0, 1, False, f"trial {k}", number=k) for k in (1, 2)]
    shown = Replay("", [(own[1], 4.25)], 8.0)
    monkeypatch.setattr("dart_skill.report._page._replay", lambda run: (shown, ""))
    run = run_of_skill("place", (DONE, JAMMED), tuple(own))
    text = page_of(run, pictures(run))
    assert "<b>1/2</b><span>trials succeeded</span>" in text
    assert "<b>15.5 mm</b><span>median error, quartiles 8.2 and 22.8" in text
    assert "<b>30.0 mm</b><span>largest error</span>" in text
    assert "All 2 movements of the arm, 8 s." in text and "</i>holder</li>" in text
    cells, where = [*filter(None, Document(text).cells)], "holder at 0.60, 0.10, 1.20 m"
    assert cells[:6] == ["1", "1.0", "done", where, "2", "30.0"]
    assert cells[6:8] == ["4.2", where]
    assert '<span class="out">failed</span>' in text and "it &lt;jammed&gt;" in text
    assert "What was shown, and tried" in text and "<h2>Demonstrations</h2>" in text


def test_a_page_on_which_nothing_was_tried_shows_no_empty_panel():
    rng = np.random.default_rng(0)
    run = run_of_skill("place", (), shown=(show(rng, draw_body(rng), role="holder"),))
    (drawn,) = pictures(run)
    assert drawn.title == "What was shown" and "(b)" in drawn.caption
    assert not any("(c)" in text for text in (drawn.svg, drawn.narrow, drawn.caption))


def test_what_became_of_trials_is_not_in_a_bag():
    text = page_of(run_of_skill("place", ()), [])
    assert "What became of trials is not in a bag" in text
    assert "The bag holds no movement that can be shown." in text


def test_the_page_of_darts_has_their_points_and_the_leg(monkeypatch):
    monkeypatch.setattr("dart_skill.report._page._replay", lambda run: (None, "not now"))
    darts = tuple(
        Dart((0.0, 0.0), (3.0, 4.0), score, ((1.0, 0.0), (0.0, 1.0)), 20.0, 0.0)
        for score in (0, *[20] * 24, 45)
    )
    leg = LegInPlay()
    thrown = [leg.hit(np.array([0.0, 103.0])), leg.hit(np.zeros(2))]
    run = DartsRun(0, "in process", (2.4, 0.0, 1.7), (), darts, LegSummary(tuple(thrown), False, 20.0))  # fmt: skip
    text = page_of(run_of_skill("darts", (), darts=run), [])
    assert "<b>21.0</b><span>points a dart, the last 25</span>" in text
    assert "A leg of 501" in text and "not finished after 2 darts" in text
    cells = [*filter(None, Document(text).cells)]
    assert cells[:7] == ["1", "501", "T20", "60", "441", "2", "441"]
    drawn = pictures(run_of_skill("darts", (), darts=run))
    assert [(one.name, bool(one.svg)) for one in drawn] == [("darts", True)]


def test_the_page_lies_beside_the_bag():
    assert page_beside(Path("/runs/one/bag")) == Path("/runs/one/report.html")
    assert page_beside(Path("/bags/throws")) == Path("/bags/throws_report.html")
    assert page_beside(Path("/bags/throws/throws_0.mcap")) == Path(
        "/bags/throws/throws_0_report.html"
    )


def test_a_page_that_cannot_be_written_leaves_no_part_of_it(tmp_path, monkeypatch):
    monkeypatch.setattr("dart_skill.report.read_run", lambda bag, about: run_of("demonstrations"))
    monkeypatch.setattr("dart_skill.report._page.pictures", lambda run: [])
    # no text that a file takes
    monkeypatch.setattr("dart_skill.report._page.page_of", lambda run, drawn: "<html>" + "\ud800")
    assert (
        main(["report", str(BAGS / "demonstrations"), "--output", str(tmp_path / "page.html")])
        == 1
    )
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_the_page_and_says_where(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("dart_skill.report.read_run", lambda *_: run_of("demonstrations"))
    monkeypatch.setattr("dart_skill.report._page._replay", lambda run: (None, "not now"))
    monkeypatch.setattr("dart_skill.report._page.pictures", lambda run: drawn_of("demonstrations"))
    page = tmp_path / "page.html"
    assert main(["report", str(BAGS / "demonstrations"), "--output", str(page), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (
        said["report"] == str(page) and len(said["demonstrations"]) == 13 and said["throws"] == []
    )
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_a_replay_shows_the_whole_way_of_the_ball_before_the_ball_goes_there(tmp_path):
    from dart_skill.report import play, read_run
    from dart_skill.view import Scene, open_server
    from tests.paths import BAGS

    run = read_run(BAGS / "throws")
    server, seen = open_server(), []
    try:
        scene = Scene(server)

        class Timeline:
            def insert_sleep(self, seconds):
                lines = server.scene.get_handle_by_name("/paths/course").points
                seen.append(np.array(lines))

        play(scene, Timeline(), run, run.own[0])
    finally:
        server.stop()
    target = run.own[0].result.target
    ends = seen[0][:, 1]
    assert np.linalg.norm(ends[:, :2] - target[:2], axis=1).min() < 0.15, "from the first picture"
    assert all(len(lines) == len(seen[0]) for lines in seen)


def test_the_board_of_darts_is_larger_than_any_other_panel():
    darts = tuple(
        Dart((0.0, 0.0), (3.0, y), 50, ((1.0, 0.0), (0.0, 1.0)), 20.0, 0.0) for y in range(9)
    )
    figure = arm_darts_figure(DartsRun(0, "in process", (2.4, 0.0, 1.7), (), darts))
    figure.draw_without_rendering()
    board, nearer, *courses = figure.axes[:5]
    heights = [axes.get_window_extent().height for axes in (board, nearer, *courses)]
    assert min(heights[:2]) > 2 * max(heights[2:])
    assert nearer.get_xlim()[1] - nearer.get_xlim()[0] < 40.0 < board.get_xlim()[1]
