"""The policy with lerobot itself: trained, saved, loaded, resumed and evaluated by its commands.

It needs lerobot 0.6, dart_skill, lerobot_policy_dsgmr and lerobot_env_dart as installed wheels;
`python -P -m pytest lerobot_policy_dsgmr/tests` with the Python that has them.
"""

import importlib.metadata
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

os.environ["HF_HUB_OFFLINE"] = "1"
torch = pytest.importorskip("torch")
pytest.importorskip("lerobot")

from lerobot.configs import PreTrainedConfig  # noqa: E402
from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402
from lerobot.policies.factory import get_policy_class, make_policy  # noqa: E402
from lerobot.scripts import lerobot_eval, lerobot_train  # noqa: E402
from lerobot.utils.import_utils import register_third_party_plugins  # noqa: E402
from safetensors.torch import load_file  # noqa: E402

from dart_skill.movement.pose import PoseDSGMR  # noqa: E402
from dart_skill.session import write_lerobot  # noqa: E402

register_third_party_plugins()
BAG = Path(__file__).resolve().parents[2] / "bags" / "demonstrations"
FRAMES = "--policy.frames=[azimuth:basket,target:basket]"
STATE, ENVIRONMENT = "observation.state", "observation.environment_state"


def typed(main, *options):
    """What a command of lerobot does with options."""
    before = sys.argv
    sys.argv = ["lerobot", *options]
    try:
        main()
    finally:
        sys.argv = before


def trained(dataset, output, *options):
    """Trains for one epoch and returns the folder of the model."""
    typed(
        lerobot_train.main,
        "--policy.type=dsgmr",
        "--dataset.repo_id=local/throws",
        f"--dataset.root={dataset}",
        f"--output_dir={output}",
        "--num_workers=0",
        *options,
    )
    return output / "checkpoints" / "last" / "pretrained_model"


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """Our 13 throws, with commands and with poses as actions."""
    folder = tmp_path_factory.mktemp("datasets")
    for action in ("commands", "pose"):
        write_lerobot(BAG, folder / action, fps=50, action=action)
    return folder


@pytest.fixture(scope="module")
def checkpoint(datasets, tmp_path_factory):
    """The model after one epoch of poses."""
    output = tmp_path_factory.mktemp("trained") / "run"
    return trained(datasets / "pose", output, "--steps=16", "--batch_size=64", FRAMES)


@pytest.fixture
def policy(checkpoint):
    return get_policy_class("dsgmr").from_pretrained(checkpoint)


@pytest.fixture(scope="module")
def situations(datasets):
    """First observations of four episodes."""
    dataset = LeRobotDataset("local/throws", root=datasets / "pose")
    rows = [dataset[int(begin)] for begin in dataset.meta.episodes["dataset_from_index"][:4]]
    return {key: torch.stack([row[key] for row in rows]) for key in (STATE, ENVIRONMENT)}


def test_lerobot_finds_the_policy_by_the_name_of_the_distribution():
    for name in ("lerobot_policy_dsgmr", "lerobot_env_dart"):
        assert importlib.metadata.distribution(name).metadata["Name"] == name
    assert "dsgmr" in PreTrainedConfig.get_known_choices()
    assert get_policy_class("dsgmr").__name__ == "DSGMRPolicy"


def test_the_settings_are_saved_and_read(checkpoint, tmp_path):
    config = PreTrainedConfig.from_pretrained(checkpoint)
    config.save_pretrained(tmp_path)
    assert PreTrainedConfig.from_pretrained(tmp_path) == config
    assert config.fps == 50 and config.action_names[-1] == "hand.open"
    with pytest.raises(ValueError, match="model is 'other': give dsgmr or per_step"):
        type(config)(model="other")


def test_a_checkpoint_has_all_that_lerobot_wants(checkpoint):
    there = {path.name for path in checkpoint.iterdir()}
    assert there >= {
        "config.json",
        "model.safetensors",
        "policy_preprocessor.json",
        "policy_postprocessor.json",
        "train_config.json",
    }


def test_poses_are_learned_on_their_manifold(policy):
    assert isinstance(policy.model.models["pose"], PoseDSGMR)


def test_each_row_of_a_batch_is_planned_alone_and_reset_begins_anew(policy, situations):
    together = [policy.select_action(situations) for _ in range(60)]
    for row in range(4):
        policy.reset()
        one = {key: value[row : row + 1] for key, value in situations.items()}
        alone = [policy.select_action(one)[0] for _ in range(60)]
        assert torch.equal(torch.stack(alone), torch.stack([step[row] for step in together]))
    lengths = torch.linalg.vector_norm(together[30][:, 3:7], dim=1)
    assert torch.allclose(lengths, torch.ones(4), atol=1e-6)


def test_after_its_end_a_movement_stays(policy, situations):
    chunk = policy.predict_action_chunk(situations)
    actions = [policy.select_action(situations) for _ in range(chunk.shape[1] + 5)]
    assert torch.equal(actions[-1], chunk[:, -1])


def test_what_is_saved_again_is_the_same_to_the_bit(policy, situations, tmp_path):
    policy.save_pretrained(tmp_path)
    again = type(policy).from_pretrained(tmp_path)
    chunks = [one.predict_action_chunk(situations) for one in (policy, again)]
    assert torch.equal(*chunks)


def test_resumed_training_learns_nothing_new(checkpoint):
    before = load_file(checkpoint / "model.safetensors")
    settings = checkpoint / "train_config.json"
    typed(lerobot_train.main, "--resume=true", f"--config_path={settings}", "--steps=18")
    last = checkpoint.parents[1] / "last" / "pretrained_model"
    after = load_file(last / "model.safetensors")
    assert last.parent.resolve().name == "000018"
    assert all(torch.equal(before[key], after[key]) for key in before) and len(before) == 2


def test_the_loss_is_the_distance_from_the_plan_and_has_no_gradient(datasets, checkpoint):
    dataset = LeRobotDataset("local/throws", root=datasets / "pose")
    config = PreTrainedConfig.from_pretrained(checkpoint)
    config.pretrained_path = checkpoint
    policy = make_policy(config, ds_meta=dataset.meta).train()
    begin, end = (dataset.meta.episodes[f"dataset_{key}_index"][2] for key in ("from", "to"))
    batch = torch.utils.data.default_collate([dataset[k] for k in range(begin, end)])
    loss, _ = policy.forward(batch)
    loss.backward()
    assert policy.without_gradient.grad == 0.0
    plan = policy.model.plan(
        batch[STATE][0].double().numpy(), batch[ENVIRONMENT][0].double().numpy()
    )
    shares = np.arange(end - begin) / (end - begin - 1) * (len(plan) - 1)
    off = batch["action"].double().numpy() - plan[np.round(shares).astype(int)]
    assert loss.item() == pytest.approx(np.mean(off**2), rel=1e-5)
    assert 0.0 < loss.item() < 0.05


def test_commands_are_learned_too_and_fewer_frames_than_an_epoch_are_refused(datasets, tmp_path):
    folder = trained(datasets / "commands", tmp_path / "run", "--steps=16", "--batch_size=64")
    policy = get_policy_class("dsgmr").from_pretrained(folder)
    assert set(policy.model.models) == {"signals"}
    with pytest.raises(ValueError, match="nothing is learned yet: .* frames .* were not met"):
        trained(datasets / "commands", tmp_path / "short", "--steps=2", "--batch_size=64")


def test_only_the_chosen_episodes_are_learned_from(datasets, tmp_path):
    folder = trained(
        datasets / "pose",
        tmp_path / "run",
        "--dataset.episodes=[3,5,8]",
        "--steps=4",
        "--batch_size=64",
        "--policy.model=per_step",
        FRAMES,
    )
    policy = get_policy_class("dsgmr").from_pretrained(folder)
    assert policy.model.models["pose"].n_demonstrations_ == 3


def test_it_is_evaluated_in_the_environment(checkpoint, tmp_path):
    typed(
        lerobot_eval.main,
        f"--policy.path={checkpoint}",
        "--env.type=dart",
        "--env.task=throw",
        "--env.fps=50",
        "--eval.n_episodes=2",
        "--eval.batch_size=2",
        "--eval.use_async_envs=false",
        f"--output_dir={tmp_path}",
    )
    told = json.loads((tmp_path / "eval_info.json").read_text())
    assert told["overall"]["n_episodes"] == 2
    assert {path.suffix for path in tmp_path.rglob("eval_episode_*")} == {".mp4"}
