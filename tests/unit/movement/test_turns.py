"""Where a movement repeats, its phase, and a clock that sets off and stops without a jump."""

import numpy as np
import pytest

from dart_skill.movement import HarmonicCycle, SoftClock, find_turns, shift_between

STEP = 0.01


def circle(phases, radius=0.05):
    angle = 2.0 * np.pi * np.asarray(phases)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])


def wipe(phases, length=0.1):
    """To and fro along a line: what is gone is gone back."""
    angle = 2.0 * np.pi * np.asarray(phases)
    return length * np.column_stack(
        [np.cos(angle), 0.2 * np.sin(2.0 * angle), np.zeros_like(angle)]
    )


def between_ways(shape, turns, period, rest=0.5, way=1.5, seed=0):
    """A straight way to a figure, a rest, the figure, a rest, a straight way; and when it turns."""
    clock = SoftClock(turns * period, 0.5 * period)
    time = np.arange(0.0, 2.0 * (way + rest) + clock.duration, STEP)
    on = np.clip(time - way - rest, 0.0, clock.duration)
    rows = shape(clock.at(on)[0] / period)
    rows += np.outer(np.clip(1.0 - time / way, 0.0, 1.0), [0.3, -0.2, 0.1])
    rows += np.outer(np.clip((time - time[-1] + way) / way, 0.0, 1.0), [0.0, 0.0, 0.2])
    rows += 1e-4 * np.random.default_rng(seed).standard_normal(rows.shape)
    return time, rows, (way + rest, way + rest + clock.duration)


@pytest.mark.parametrize("shape", [circle, wipe])
@pytest.mark.parametrize(("turns", "period"), [(3, 1.4), (2, 2.5), (6, 0.6)])
def test_turns_are_found_between_the_ways(shape, turns, period):
    time, rows, (begin, end) = between_ways(shape, turns, period)
    found = find_turns(time, rows)
    assert found.period == pytest.approx(period, rel=0.03)
    assert begin - 0.02 < found.begin < begin + 0.4 * period
    assert end - 0.4 * period < found.end < end + 0.02
    assert found.number == pytest.approx(turns, abs=0.3)


def test_what_does_not_repeat_is_refused_with_what_to_show():
    time = np.arange(0.0, 4.0, STEP)
    straight = np.outer(time / 4.0, [0.3, 0.1, 0.2])
    once = between_ways(circle, 1, 1.5)
    for rows in (straight, np.zeros((len(time), 3)), once[1]):
        with pytest.raises(ValueError, match="show at least 2 turns"):
            find_turns(STEP * np.arange(len(rows)), rows)


@pytest.mark.parametrize("shift", [0.0, 0.13, 0.5, 0.97])
def test_the_shift_between_two_cycles_is_found(shift):
    phases = np.arange(200) / 200
    found = shift_between(wipe(phases), 1.1 * wipe(phases - shift) + 0.3)
    assert (found - shift + 0.5) % 1.0 - 0.5 == pytest.approx(0.0, abs=1e-3)


def test_a_cycle_in_the_other_sense_is_refused():
    phases = np.arange(200) / 200
    with pytest.raises(ValueError, match="in the same sense"):
        shift_between(circle(phases), circle(-phases))


def test_a_cycle_is_found_though_a_person_turns_unevenly():
    """A least-squares fit to even phases is off by millimetres."""
    even = np.arange(0.0, 3.0, 0.01)
    true = even + 0.03 * np.sin(2.0 * np.pi * 0.37 * even)
    cycle = HarmonicCycle([even], [circle(true)])
    made, slope, curvature = cycle.at(np.linspace(0.0, 1.0, 100))
    assert np.hypot(*made[:, :2].T) == pytest.approx(0.05, abs=3e-4)
    assert np.linalg.norm(slope, axis=1) == pytest.approx(0.05 * 2.0 * np.pi, rel=0.05)
    assert np.linalg.norm(curvature, axis=1) == pytest.approx(0.05 * (2.0 * np.pi) ** 2, rel=0.2)
    later = cycle.phases[0] - true
    assert np.ptp(later) < 0.02, "but for where phase zero is"


def test_derivatives_of_a_cycle_are_those_of_its_values():
    even = np.arange(0.0, 2.0, 0.01)
    cycle, phases, step = HarmonicCycle([even], [wipe(even)]), np.linspace(0.0, 1.0, 50), 1e-5
    before, after = (cycle.at(phases + one) for one in (-step, step))
    _, slope, curvature = cycle.at(phases)
    assert slope == pytest.approx((after[0] - before[0]) / (2.0 * step), abs=1e-6)
    assert curvature == pytest.approx((after[1] - before[1]) / (2.0 * step), abs=1e-4)


def test_a_soft_clock_starts_and_stops_without_a_jump():
    clock = SoftClock(3.0, 0.5)
    time = np.linspace(0.0, clock.duration, 7001)
    shows, rate, change = clock.at(time)
    assert clock.duration == 3.5 and shows[[0, -1]] == pytest.approx([0.0, 3.0], abs=1e-12)
    assert rate[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    assert change[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    assert np.gradient(shows, time)[1:-1] == pytest.approx(rate[1:-1], abs=1e-5)
    assert np.gradient(rate, time)[1:-1] == pytest.approx(change[1:-1], abs=1e-4)
    assert rate[1000:6000] == pytest.approx(1.0) and np.abs(np.diff(change)).max() < 0.03
