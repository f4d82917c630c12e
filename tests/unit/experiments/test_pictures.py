"""Figures of the experiments basket and practice: every throw counts once, places are right, the
same data give the same bytes.
"""

from collections import Counter
from xml.etree import ElementTree

import numpy as np
import pytest

from dart_skill.common.regions import REGION
from dart_skill.experiments.studies import basket, basket_maps, practice
from dart_skill.experiments.studies.basket import ASKED, ModelThrows, throws_of
from dart_skill.experiments.studies.basket_maps import (
    AZIMUTHS,
    DISTANCES,
    cells_of,
    draw_basket,
    draw_map,
    wilson,
)
from dart_skill.experiments.studies.practice_curves import draw_practice, errors_after

SVG = "{http://www.w3.org/2000/svg}"


def run_of(seed=0, models=("default", "weighted"), demonstrations=13, n=60):
    """A run whose first model hits, and whose second one refuses what is farther than 2.5 m."""
    rng = np.random.default_rng([seed, demonstrations])
    targets = ASKED.spread(n, rng)
    miss, far = rng.normal(0.0, 0.02, (2, 2, n)), np.hypot(*targets.T[:2]) > 2.5
    refused = np.array([np.zeros(n, dtype=bool), far])
    miss[:, refused] = np.nan
    inside = ~refused & (np.hypot(*np.nan_to_num(miss)) < 0.15)

    def rows(array):
        return tuple(tuple(row) for row in array.tolist())

    shown = REGION.spread(demonstrations, rng)
    task = basket.BasketTask(seed, models, demonstrations, n)
    return basket.BasketRun(
        task, rows(targets), rows(miss[0]), rows(miss[1]), rows(inside), rows(refused), rows(shown)
    )


def texts_and_ids(paths):
    root = ElementTree.parse(next(path for path in paths if path.suffix == ".svg")).getroot()
    ids = [element.get("id") for element in root.iter() if element.get("id")]
    assert not [one for one, times in Counter(ids).items() if times > 1], "every id once"
    return ["".join(element.itertext()) for element in root.iter(f"{SVG}text")], ids


def twice(tmp_path, draw):
    first, second = draw(tmp_path / "first"), draw(tmp_path / "second")
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    return first


# maps


def test_the_borders_of_what_is_demonstrated_are_borders_of_cells():
    for borders, values in (
        (AZIMUTHS, (-REGION.side, REGION.side, -ASKED.side, ASKED.side)),
        # fmt: skip
        (DISTANCES, (REGION.near, REGION.far, ASKED.near, ASKED.far)),
    ):
        assert np.abs(np.subtract.outer(values, borders)).min(axis=1).max() < 1e-12, (
            f"{values} among {borders}"
        )


def test_every_throw_is_in_one_cell():
    throws = throws_of([run_of()], "weighted", 13)
    cells = cells_of(throws)
    assert cells.throws.sum() == 60 and cells.refused.sum() == throws.refused.sum() > 0
    hits = np.nansum(cells.inside * cells.throws)
    assert hits == pytest.approx(throws.in_basket.sum())
    assert (np.isnan(cells.inside) == (cells.throws == 0)).all()


def test_a_throw_to_the_left_and_far_away_is_in_the_last_cell():
    corner = ASKED.far * np.array([np.cos(ASKED.side), np.sin(ASKED.side)])
    cells = cells_of(
        ModelThrows(
            np.array([[*corner, 0.4]]),
            np.array([[0.03, -0.04]]),
            np.array([True]),
            np.array([False]),
        )
    )
    assert (
        cells.throws[-1, -1] == 1
        and cells.inside[-1, -1] == 1.0
        and cells.median[-1, -1] == pytest.approx(0.05)
    )


@pytest.mark.parametrize(
    ("target", "what"), [((3.5, 0.0, 0.4), "distance 3.500"), ((0.5, 1.5, 0.4), "azimuth 1.249")]
)
def test_a_basket_beyond_the_map_is_an_error(target, what):
    with pytest.raises(ValueError, match=f"{what} lies outside of the map"):
        cells_of(
            ModelThrows(np.array([target]), np.zeros((1, 2)), np.array([True]), np.array([False]))
        )


@pytest.mark.slow
def test_a_map_has_every_cell_and_hatches_those_without_a_landing(tmp_path):
    results = [run_of()]
    texts, ids = texts_and_ids(
        twice(tmp_path, lambda folder: draw_map(results, "weighted", 13, folder))
    )
    cells = cells_of(throws_of(results, "weighted", 13))
    for panel in ("share", "median"):
        count = {
            kind: sum(one.startswith(f"{panel}_{kind}_") for one in ids)
            for kind in ("cell", "refused", "never")
        }
        assert (
            count["never"] == (cells.throws == 0).sum()
            and count["cell"] == np.isfinite(cells.median).sum()
        ), count
        assert count["refused"] == ((cells.throws > 0) & np.isnan(cells.median)).sum() > 0, count
    share = throws_of(results, "weighted", 13).in_basket.mean()
    said = " ".join(texts)
    for part in (
        f"{100 * share:.1f} % of 60 throws",
        "Model 'weighted' after 13 demonstrations",
        "[%]",
        "[cm]",
        "ahead of the arm [m]",
    ):
        assert part in said, texts


def test_the_left_of_the_arm_is_the_left_of_the_map(tmp_path):
    """A single throw far to the left: its cell is left of the one straight ahead."""
    one = run_of(n=1)
    left = basket.BasketRun(
        one.task,
        ((1.2, 1.6, 0.4),),
        ((0.01,),) * 2,
        ((0.0,),) * 2,
        ((True,),) * 2,
        ((False,),) * 2,
        one.shown,
    )
    root = ElementTree.parse(draw_map([left], "default", 13, tmp_path)[0]).getroot()
    groups = {element.get("id"): element for element in root.iter(f"{SVG}g")}

    def x(gid):
        return float(next(groups[gid].iter(f"{SVG}path")).get("d").split()[1])

    cell = next(gid for gid in groups if gid and gid.startswith("share_cell_"))
    row = cell.rsplit("_", 1)[1]
    assert x(cell) < x(f"share_never_4_{row}") < x(f"share_never_0_{row}")


def test_the_curve_is_drawn_if_there_are_several_numbers_of_demonstrations(tmp_path, monkeypatch):
    monkeypatch.setattr(
        basket_maps,
        "draw_map",
        lambda results, model, demonstrations, folder: [
            folder / f"map_{model}_{demonstrations}.svg"
        ],
    )
    assert [path.stem for path in draw_basket([run_of()], tmp_path)] == [
        "map_default_13",
        "map_weighted_13",
    ]
    paths = draw_basket([run_of(demonstrations=n) for n in (5, 13)], tmp_path)
    assert len(paths) == 4 + 2
    texts, _ = texts_and_ids(paths[4:])
    assert {"5", "13", "default", "weighted", "demonstrations"} <= set(texts)
    assert any("landing error [cm]" in text for text in texts)


@pytest.mark.parametrize(("hits", "n"), [(0, 20), (7, 20), (20, 20), (395, 400)])
def test_the_interval_is_where_a_score_test_does_not_reject(hits, n):
    low, share, high = wilson(hits, n)
    assert 0.0 <= low <= share == hits / n <= high <= 1.0
    for end in (low, high):
        if 0.0 < end < 1.0:
            assert abs(share - end) / np.sqrt(end * (1 - end) / n) == pytest.approx(1.96, rel=1e-9)


def test_an_interval_of_no_throws_is_refused():
    with pytest.raises(ValueError, match="0 hits of 0"):
        wilson(0, 0)


# practice


def practised(seed=0, method="residual", change="none", change_after=0):
    rng = np.random.default_rng([seed, len(method)])
    task = practice.PracticeTask(seed, method, 13, 10, change, change_after, (0, 5, 10), 6)
    errors = rng.rayleigh(0.02, (3, 6))
    errors[0, 0] = np.nan
    inside = np.nan_to_num(errors, nan=1.0) < 0.15
    return practice.PracticeRun(
        task,
        (0.02,) * 10,
        (True,) * 10,
        *(tuple(tuple(row) for row in part.tolist()) for part in (errors, inside)),
    )


def test_errors_are_those_of_the_test_after_so_many_throws():
    errors, inside = errors_after([practised(0), practised(1)], 0)
    assert len(errors) == len(inside) == 12 and np.isnan(errors).sum() == 2 and inside.sum() == 10
    assert errors_after([practised()], 5)[0].tolist() == list(practised().test_errors[1])
    assert len(errors_after([practised()], 7)[0]) == 0


def test_practice_shows_every_method_the_floor_and_the_change(tmp_path):
    results = [
        practised(seed, method, "friction", 5)
        for seed in range(3)
        for method in ("residual", "none")
    ]
    texts, _ = texts_and_ids(
        twice(tmp_path, lambda folder: draw_practice(results, folder, floor=0.009))
    )
    said = " ".join(texts)
    for part in (
        "residual",
        "none",
        "hand's repeatability, 0.90 cm",
        "then friction doubled",
        "change",
        "n = 3 runs of 6",
        "own throws",
        # fmt: skip
        "6 of 108 throws had no plan",
        "landing error [cm]",
        "in the basket [%]",
    ):
        assert part in said, texts


def test_demonstrations_and_changes_get_figures_of_their_own(tmp_path):
    results = [
        practised(),
        practised(change="friction"),
        practised(change="friction", change_after=5),
    ]
    assert [path.stem for path in draw_practice(results, tmp_path)[::2]] == [
        "practice_13_none", "practice_13_friction", "practice_13_friction_after_5"
    ]  # fmt: skip
