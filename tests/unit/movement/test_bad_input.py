"""What a user may hand in by mistake, to every function of the movement layer: a clear ValueError,
or the right answer. Never NaN.
"""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dart_skill.movement as movement

N = 40
TIME = 0.01 * np.arange(N)
PATH = np.column_stack([np.sin(3 * TIME), TIME**2, np.cos(2 * TIME)])
QUATERNIONS = movement.quaternions_from_angles(np.column_stack([1.0 + TIME, 0.3 * TIME, -TIME]))
MOTION = movement.Motion(PATH, np.gradient(PATH, 0.01, axis=0), np.zeros_like(PATH))
TASKS = np.array([[1.5, 0.0], [1.8, 0.3], [2.1, -0.4], [2.4, 0.1]])
WORLD_OF = {d: [movement.TaskFrame(np.eye(d + 1), np.zeros(d + 1))] for d in (1, 2, 3)}
WORLD = WORLD_OF[3]
PATHS = np.stack([PATH + 0.01 * k * TIME[:, None] for k in range(4)])

CALLS = {
    "normalise": (QUATERNIONS,),
    "make_continuous": (QUATERNIONS,),
    "multiply": (QUATERNIONS, QUATERNIONS),
    "rotate": (QUATERNIONS, PATH),
    "turn_about_z": (QUATERNIONS, 0.3),
    "angles_from_quaternions": (QUATERNIONS,),
    "quaternions_from_angles": (PATH,),
    "pointing_angles": (PATH + 1.0,),
    "angular_velocity": (TIME, QUATERNIONS),
    "features": (TIME, PATH, QUATERNIONS, 0.2),
    "smooth_derivatives": (TIME, PATH),
    "estimate_noise": (TIME, PATH),
    "speed": (TIME, PATH),
    "attractor_from_motion": (*MOTION, 200.0),
    "follow_attractor": (PATH, 0.01, PATH[0], np.zeros(3), 200.0),
    "critical_damping": (np.array([100.0, 200.0]),),
    "azimuth_of": (np.array([1.0, 2.0, 0.4]),),
    "azimuth_frame": (0.4, np.zeros(3)),
    "azimuth_target_frame": (np.array([1.0, 2.0, 0.4]),),
    "start_frame": (PATH[0],),
    "target_frame": (np.array([1.0, 2.0, 0.4]), np.array([0.1, 0.2])),
    "pointing_at": (np.array([1.0, 2.0, 0.4]), PATH[0]),
    "nearest_weights": (TASKS, TASKS[0], 2),
    "gaussian_weights": (TASKS, TASKS[0], 0.3),
    "stiffness_from_covariance": (np.tile(1e-4 * np.eye(3), (N, 1, 1)), 50.0, 500.0),
    "TaskFrame": (np.eye(4), np.zeros(4)),
}
SPOILS = {
    "nan": lambda a: _with(a, np.nan),
    "inf": lambda a: _with(a, np.inf),
    "minus inf": lambda a: _with(a, -np.inf),
    "empty": lambda a: a[:0] if np.ndim(a) else np.empty(0),
    "one dimension more": lambda a: np.asarray(a)[None],
    "words": lambda a: np.full(np.shape(a), "three").tolist(),
    "nothing": lambda a: None,
}
# What the rule does not hold for: numbers where one per dimension or none at all is as good.
ALLOWED = {
    ("attractor_from_motion", 3): {"one dimension more"},
    ("follow_attractor", 4): {"one dimension more"},
    ("target_frame", 1): {"empty"},
}


def _with(array, value):
    spoilt = np.array(array, dtype=float)
    spoilt.flat[spoilt.size // 2] = value
    return spoilt


def numbers_in(result) -> np.ndarray:
    """All numbers of a result, whatever holds them."""
    if isinstance(result, movement.TaskFrame):
        result = (result.A, result.b)
    return (
        np.concatenate([np.ravel(part) for part in result])
        if isinstance(result, tuple)
        else np.ravel(result)
    )


CASES = [
    (name, place, spoil)
    for name, arguments in CALLS.items()
    for place in range(len(arguments))
    for spoil in SPOILS
    if spoil not in ALLOWED.get((name, place), ())
]


@pytest.mark.parametrize(
    ("name", "place", "spoil"), CASES, ids=lambda part: str(part).replace(" ", "_")
)
def test_a_bad_argument_is_refused_by_name(name, place, spoil):
    arguments = list(CALLS[name])
    arguments[place] = SPOILS[spoil](arguments[place])
    with pytest.raises(ValueError, match=r"\w{3,}"):
        getattr(movement, name)(*arguments)


@pytest.mark.parametrize("name", CALLS)
def test_lists_are_as_good_as_arrays_and_arguments_stay_as_they_were(name):
    arguments = CALLS[name]
    kept = [np.array(argument) for argument in arguments]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        expected = numbers_in(getattr(movement, name)(*arguments))
        from_lists = numbers_in(
            getattr(movement, name)(*[np.asarray(argument).tolist() for argument in arguments])
        )
    np.testing.assert_array_equal(from_lists, expected)
    assert np.isfinite(expected).all()
    for argument, before in zip(arguments, kept, strict=True):
        np.testing.assert_array_equal(argument, before)


def fit(paths, time=TIME, n_components=3):
    model = movement.DSGMR(n_components, 200.0)
    attractors = [model.encode(time, path) for path in paths]
    return model.fit(attractors, [WORLD_OF[np.shape(paths[0])[1]]] * len(paths))


@pytest.mark.parametrize("spoil", [name for name in SPOILS if name != "one dimension more"])
def test_the_model_refuses_bad_demonstrations(spoil):
    with pytest.raises(ValueError, match=r"\w{3,}"):
        fit([*PATHS[:2], SPOILS[spoil](PATHS[2])])


@pytest.mark.parametrize("n_components", [0, -1, 2.5, "three", None, True, 10_000])
def test_an_impossible_number_of_components_is_refused(n_components):
    with pytest.raises(ValueError, match=r"n_components|components"):
        fit(PATHS, n_components=n_components)


def test_demonstrations_that_stand_still_are_learned_as_standing_still():
    still = np.tile(PATH[0], (3, N, 1))
    movement_made = fit(still).reproduce(WORLD, TIME, PATH[0], np.zeros(3))
    np.testing.assert_allclose(movement_made.position, still[0], atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    scale=st.sampled_from([1e-8, 1e-3, 1.0, 1e3, 1e8]),
    offset=st.sampled_from([0.0, 1.0, -1e3, 1e6]),
    columns=st.lists(st.integers(0, 2), min_size=1, max_size=3),
)
def test_units_and_places_change_nothing_but_units_and_places(scale, offset, columns):
    """Also with one column that repeats another, which makes every covariance singular."""
    plain = fit(PATHS[:, :, columns]).reproduce(
        WORLD_OF[len(columns)], TIME, PATH[0, columns], np.zeros(len(columns))
    )
    moved = fit(scale * (PATHS[:, :, columns] + offset))
    other = moved.reproduce(
        WORLD_OF[len(columns)], TIME, scale * (PATH[0, columns] + offset), np.zeros(len(columns))
    )
    np.testing.assert_allclose(
        other.position / scale - offset, plain.position, atol=1e-6 * max(1.0, 1e-4 * abs(offset))
    )


@settings(max_examples=20, deadline=None)
@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e3))
def test_far_away_in_time_the_attractor_stays_finite(instant, duration):
    model = fit(PATHS)
    mean, covariance = model.retrieve(WORLD, instant + duration * np.array([0.0, 0.5, 1.0]))
    assert np.isfinite(mean).all() and np.isfinite(covariance).all()
    assert (np.linalg.eigvalsh(covariance) >= 0.0).all()
