"""Movement models on disk: they come back to the last bit, and what is no such file is refused in
a line.
"""

import numpy as np
import pytest

from dart_skill.movement import (
    DSGMR,
    KMP,
    AutonomousDSGMR,
    DiscretePrimitive,
    PartialFrame,
    PerStepGaussians,
    PhaseRule,
    ProMP,
    RhythmicPrimitive,
    TaskFrame,
    TaskParameterisedMixture,
    smooth_derivatives,
)
from dart_skill.movement.pose import (
    DiscretePosePrimitive,
    PoseDSGMR,
    PoseFrame,
    RhythmicPosePrimitive,
    TaskParameterisedPoseMixture,
)

TIME = np.linspace(0.0, 1.0, 101)
GOALS = np.random.default_rng(0).uniform(0.3, 0.8, (4, 2))


def path(goal):
    s = TIME**3 * (10.0 - 15.0 * TIME + 6.0 * TIME**2)
    return np.outer(s, goal) + np.outer(np.sin(np.pi * s), [0.0, 0.1])


def frames(goal):
    return [TaskFrame(np.eye(3), np.zeros(3)), TaskFrame(np.eye(3), [0.0, *goal])]


def ds_gmr():
    model = DSGMR(4, stiffness=[150.0, 1.0 / 3.0 + 200.0], overlap=0.5, covariance_floor=1e-5)
    return model.fit(
        [model.encode(TIME, path(goal)) for goal in GOALS], [frames(goal) for goal in GOALS]
    )


def ds_gmr_with_an_input():
    model = DSGMR(3, n_inputs=1, partition="time", damping=20.1, n_shared=2)
    lifted = [[TaskFrame(np.eye(4), np.zeros(4))] for _ in GOALS]
    return model.fit([model.encode(TIME, path(goal), inputs=goal[:1]) for goal in GOALS], lifted)


def autonomous():
    motions = [smooth_derivatives(TIME, path(goal)) for goal in GOALS]
    return AutonomousDSGMR(4, rule=PhaseRule(slowest=0.1, ignored=1.0 / 3.0)).fit(
        [TIME] * 4, motions, [frames(goal) for goal in GOALS]
    )


def discrete():
    return DiscretePrimitive(20, goal_path="fixed").fit([TIME] * 4, [path(goal) for goal in GOALS])


def rhythmic():
    time = np.linspace(0.0, 5.0, 501)
    return RhythmicPrimitive(25).fit(
        time, np.column_stack([np.sin(4.0 * time), np.cos(8.0 * time)])
    )


def samples():
    return [np.column_stack([TIME, path(goal)]) for goal in GOALS]


def per_step():
    model = PerStepGaussians(50, covariance_prior=1.0 / 3.0, smoothness=0.2)
    return model.fit(samples(), [frames(goal) for goal in GOALS])


def promp():
    return ProMP(10, covariance_prior=1.0).fit(samples())


def kmp():
    return KMP(4, n_references=40).fit(samples())


def poses(goal):
    half = 0.5 * np.outer(TIME, [0.0, goal[0], goal[1]])
    rotation = np.column_stack([np.sin(half), np.sqrt(1.0 - np.square(np.sin(half)).sum(1))])
    return np.column_stack([path(goal), TIME, rotation])


def pose_ds_gmr():
    model = PoseDSGMR(4, stiffness=[200.0, 250.0])
    still = [PoseFrame(np.zeros(3), [0.0, 0.0, 0.0, 1.0])]
    return model.fit([model.encode(TIME, poses(goal)) for goal in GOALS], [still] * 4)


def discrete_pose():
    return DiscretePosePrimitive(20).fit([TIME] * 4, [poses(goal) for goal in GOALS])


def rhythmic_pose():
    time = np.linspace(0.0, 5.0, 501)
    turn = 0.2 * np.sin(4.0 * time)
    zero = np.zeros_like(time)
    return RhythmicPosePrimitive(25).fit(
        time, np.column_stack([turn, zero, zero, np.sin(turn), zero, zero, np.cos(turn)])
    )


def moved(model):
    """Everything that a model says of a new situation, as one array."""
    new = [0.55, 0.6]
    if isinstance(model, DSGMR):
        n_inputs = model.n_inputs
        where = frames(new) if n_inputs == 0 else [TaskFrame(np.eye(4), np.zeros(4))]
        made = model.reproduce(
            where, TIME, [0.0, 0.0], [0.0, 0.0], inputs=[0.5] if n_inputs else None
        )
        return np.concatenate([made.position.ravel(), made.covariance.ravel()])
    if isinstance(model, PerStepGaussians):
        mean, covariance = model.retrieve(frames(new), TIME)
        return np.concatenate([mean.ravel(), covariance.ravel()])
    if isinstance(model, (ProMP, KMP)):
        mean, covariance = model.between([0.0, 0.0], new).retrieve(TIME)
        return np.concatenate([mean.ravel(), covariance.ravel()])
    if isinstance(model, AutonomousDSGMR):
        made = model.reproduce(frames(new), [0.0, 0.1], [0.0, 0.0], duration=1.5)
        return np.concatenate(
            [made.position.ravel(), made.phase, model.goal(frames(new)), np.ravel(model.ends)]
        )
    if isinstance(model, PoseDSGMR):
        made = model.reproduce([PoseFrame(new + [0.1], [0.0, 0.0, 0.6, 0.8])], TIME, poses(new)[0])
        return np.concatenate([made.pose.ravel(), made.covariance.ravel()])
    made = model.open_loop(0.01, model.begin(amplitude=1.1))
    return np.concatenate([made.velocity.ravel(), made.acceleration.ravel()])


MAKERS = [
    ds_gmr,
    ds_gmr_with_an_input,
    autonomous,
    discrete,
    rhythmic,
    pose_ds_gmr,
    discrete_pose,
    rhythmic_pose,
    per_step,
    promp,
    kmp,
]


@pytest.fixture(scope="module", params=MAKERS, ids=lambda maker: maker.__name__)
def model(request):
    return request.param()


@pytest.fixture
def saved(model, tmp_path):
    model.save(tmp_path / "model.npz")
    return tmp_path / "model.npz"


def rewrite(path, **changes):
    with np.load(path) as archive:
        content = {**dict(archive), **changes}
    np.savez(path, **{name: value for name, value in content.items() if value is not None})


def test_a_model_comes_back_to_the_last_bit(model, saved):
    loaded = type(model).load(saved)
    assert np.array_equal(moved(loaded), moved(model))
    assert repr(loaded) == repr(model) and loaded.n_demonstrations_ == model.n_demonstrations_
    loaded.save(saved.with_name("again.npz"))
    assert np.array_equal(moved(type(model).load(saved.with_name("again.npz"))), moved(model))


def test_a_clone_has_the_same_hyper_parameters_and_nothing_fitted(model):
    copied = model.__sklearn_clone__()
    assert repr(copied) == repr(model).split(": ")[0] and ": " in repr(model)
    with pytest.raises(ValueError, match="call fit"):
        copied.save("anywhere.npz")
    assert repr(copied.set_params(**copied.get_params())) == repr(copied)


def test_what_was_fitted_with_other_hyper_parameters_is_forgotten():
    model = ds_gmr().set_params(stiffness=300.0)
    assert model.stiffness == 300.0 and model.damping == pytest.approx(2.0 * np.sqrt(300.0))
    with pytest.raises(ValueError, match="call fit first"):
        model.product(frames(GOALS[0]))
    with pytest.raises(
        ValueError, match="Invalid parameter 'stifness' for DSGMR; it has n_components"
    ):
        model.set_params(stifness=1.0)


def test_a_model_says_what_it_is():
    assert (
        repr(ds_gmr())
        == "DSGMR(n_components=4, stiffness=[150.0, 200.33333333333334], overlap=0.5,"
        " covariance_floor=1e-05): 4 demonstrations, 2 movement variables, 4 components in 2"
        " task frames"
    )
    assert repr(autonomous()).endswith(
        ": 4 demonstrations, 2 movement variables, 4 components in 2 task frames"
    )
    assert (
        repr(discrete())
        == "DiscretePrimitive(n_basis=20, goal_path='fixed'): 4 demonstrations, 2 movement"
        " variables, 20 kernels"
    )
    assert (
        repr(rhythmic_pose())
        == "RhythmicPosePrimitive(n_basis=25): 1 demonstration, positions and orientations, 25"
        " kernels"
    )
    assert repr(DSGMR(3)) == "DSGMR(n_components=3)"


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.7, 0.99])
def test_a_truncated_file_is_refused_in_a_line(model, saved, share):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    refused(type(model), saved, "")


def refused(kind, path, message):
    with pytest.raises(
        ValueError, match=f"{path.name} holds no {kind.__name__} that can be read: .*{message}"
    ) as caught:
        kind.load(path)
    assert "\n" not in str(caught.value)


def test_every_flipped_byte_is_noticed_or_does_no_harm(tmp_path):
    model = discrete()
    model.save(tmp_path / "model.npz")
    whole, rng = (tmp_path / "model.npz").read_bytes(), np.random.default_rng(1)
    for place in rng.integers(0, len(whole), 60):
        flipped = bytearray(whole)
        flipped[place] ^= 0xFF
        (tmp_path / "flipped.npz").write_bytes(flipped)
        try:
            # a time stamp of the archive
            assert np.array_equal(
                moved(DiscretePrimitive.load(tmp_path / "flipped.npz")), moved(model)
            )
        except ValueError as error:
            assert "holds no DiscretePrimitive" in str(error)


def test_another_model_or_version_is_named(tmp_path):
    ds_gmr().save(tmp_path / "model.npz")
    refused(AutonomousDSGMR, tmp_path / "model.npz", r"it holds a DSGMR: read it with DSGMR\.load")
    rewrite(tmp_path / "model.npz", format=np.array("dart_skill DSGMR 2"))
    refused(
        DSGMR,
        tmp_path / "model.npz",
        "it has version 2, and this dart_skill reads version 1: fit the model again",
    )
    rewrite(tmp_path / "model.npz", format=np.array("dart_skill skill 1"))
    refused(DSGMR, tmp_path / "model.npz", "it holds a skill")
    (tmp_path / "text.npz").write_text("stiffness: 200\n")
    refused(DSGMR, tmp_path / "text.npz", "")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"priors": np.array([0.5, 0.5, 0.5, 0.5])}, "sum to one"),
        ({"priors": None}, "has no 'priors'"),
        ({"means.1": None}, "has no 'means.1'"),
        ({"means.0": np.full((4, 3), np.nan)}, "holds nan"),
        ({"means.0": np.zeros((3, 3))}, "means.0 have the shape"),
        ({"covariances.1": np.zeros((4, 3, 3))}, "not positive definite"),
        ({"n_features": np.array(2)}, "do not fit 2 features"),
        ({"about": np.array("{}")}, "has no 'parameters'"),
        (
            {"about": np.array('{"parameters": {"n_components": 0}, "n_demonstrations": 1}')},
            "n_components must be",
        ),
        ({"priors": np.array([{"a": 1}], dtype=object)}, "Object arrays|bytes"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, changes, message):
    ds_gmr().save(tmp_path / "model.npz")
    rewrite(tmp_path / "model.npz", **changes)
    refused(DSGMR, tmp_path / "model.npz", f"({message})")


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    model = discrete()
    model.save(tmp_path / "model.npz")
    before = (tmp_path / "model.npz").read_bytes()
    with pytest.raises(FileExistsError):
        model.save(tmp_path / "model.npz")
    assert (tmp_path / "model.npz").read_bytes() == before
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        model.save(tmp_path / "nowhere" / "model.npz")
    with pytest.raises(FileNotFoundError):
        DiscretePrimitive.load(tmp_path / "none.npz")
    with pytest.raises(ValueError, match="call fit first"):
        DSGMR(2).save(tmp_path / "unfitted.npz")
    assert [one.name for one in tmp_path.iterdir()] == ["model.npz"]


def test_mixtures_in_task_frames_have_files_too(tmp_path):
    seen = PartialFrame(np.eye(3)[:, :2], np.zeros(3))
    samples = [np.column_stack([TIME, path(goal)]) for goal in GOALS]
    mixture = TaskParameterisedMixture(3).fit(
        samples, [[TaskFrame(np.eye(3), np.zeros(3)), seen]] * 4
    )
    mixture.save(tmp_path / "mixture.npz")
    loaded = TaskParameterisedMixture.load(tmp_path / "mixture.npz")
    place = [None, None]
    for other in (mixture, loaded):
        place[other is loaded] = other.product([TaskFrame(np.eye(3), np.ones(3)), seen]).means_
    assert np.array_equal(*place)
    pose = pose_ds_gmr().mixture_
    pose.save(tmp_path / "pose.npz")
    assert np.array_equal(
        TaskParameterisedPoseMixture.load(tmp_path / "pose.npz").covariances_, pose.covariances_
    )
