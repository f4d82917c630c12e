"""The distributions of the plug-ins: lerobot imports them by the name in their metadata, and finds
classes by the names of modules. What needs lerobot itself stands in lerobot_policy_dsgmr/tests.
"""

import ast
import dataclasses
import importlib.metadata
import re
import shutil
import subprocess
import sys
import types
import zipfile
from email.parser import Parser
from enum import Enum

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from tests.paths import ROOT
from tests.unit.lerobot_plugins.task_models import PACKAGE, load, task_model

if sys.version_info >= (3, 11):
    import tomllib

NAMES = ("lerobot_policy_dsgmr", "lerobot_env_dart")


def project(name):
    with open(ROOT / name / "pyproject.toml", "rb") as file:
        return tomllib.load(file)


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 reads no TOML")
@pytest.mark.parametrize("name", NAMES)
def test_each_has_the_name_of_its_package_and_what_builds_it_keeps_that_name(name):
    """lerobot looks for names that begin with lerobot_policy_ or lerobot_env_, and imports a package
    of the same name. Setuptools before 69.5 writes hyphens in their place.
    """
    told = project(name)
    assert told["project"]["name"] == name
    assert told["tool"]["setuptools"]["packages"] == [name]
    assert (ROOT / name / name / "__init__.py").is_file()
    (setuptools,) = map(Requirement, told["build-system"]["requires"])
    assert not setuptools.specifier.contains("69.0") and setuptools.specifier.contains("69.5")


@pytest.mark.skipif(
    Version(importlib.metadata.version("setuptools")) < Version("69.5"),
    reason="this setuptools writes hyphens",
)
@pytest.mark.parametrize("name", NAMES)
def test_the_name_in_the_wheel_has_underscores(name, tmp_path):
    pytest.importorskip("wheel")
    source = tmp_path / "source"
    shutil.copytree(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--no-build-isolation", "--ignore-requires-python"]
    subprocess.run([*pip, *options, "--wheel-dir", str(tmp_path), str(source)], check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as content:
        files = content.namelist()
        (about,) = (file for file in files if file.endswith("/METADATA"))
        told = Parser().parsestr(content.read(about).decode())
    assert told["Name"] == name
    assert {file.split("/")[0].split("-")[0] for file in files} == {name}


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 reads no TOML")
def test_nothing_else_depends_on_them():
    for name in NAMES:
        needed = {Requirement(text).name for text in project(name)["project"]["dependencies"]}
        assert needed == {"dart_skill", "lerobot"}
    files = (ROOT / "setup.py", ROOT / "package.xml", *(ROOT / "requirements").glob("*.txt"))
    assert not [file.name for file in files if re.search("lerobot_(policy|env)", file.read_text())]


def test_classes_and_functions_are_where_lerobot_looks_for_them():
    defined = {
        path.stem: {getattr(node, "name", "") for node in ast.parse(path.read_text()).body}
        for path in PACKAGE.glob("*.py")
    }
    assert "DSGMRConfig" in defined["configuration_dsgmr"]
    assert "DSGMRPolicy" in defined["modeling_dsgmr"]
    assert "make_dsgmr_pre_post_processors" in defined["processor_dsgmr"]


class NormalizationMode(Enum):
    IDENTITY = "IDENTITY"


@dataclasses.dataclass
class PreTrainedConfig:
    """What lerobot documents of its base class, as far as the settings use it."""

    device: str | None = None
    push_to_hub: bool = True
    input_features: dict = dataclasses.field(default_factory=dict)
    output_features: dict = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        self.device = self.device or "cuda"

    @classmethod
    def register_subclass(cls, name):
        return lambda made: made

    @property
    def robot_state_feature(self):
        return self.input_features.get("observation.state")

    @property
    def action_feature(self):
        return self.output_features.get("action")


@dataclasses.dataclass
class SGDConfig:
    lr: float = 1e-3


@pytest.fixture
def config_class(monkeypatch):
    """The settings over a stand-in for lerobot."""
    configs, optim = types.ModuleType("lerobot.configs"), types.ModuleType("lerobot.optim")
    configs.PreTrainedConfig = PreTrainedConfig
    configs.NormalizationMode = NormalizationMode
    optim.SGDConfig = optim.OptimizerConfig = SGDConfig
    for module in (types.ModuleType("lerobot"), configs, optim):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(sys.modules, "lerobot_policy_dsgmr", types.ModuleType("package"))
    return load("configuration_dsgmr").DSGMRConfig


def test_nothing_is_uploaded_scaled_or_changed_by_gradients_unless_it_is_asked_for(config_class):
    config = config_class()
    assert (config.device, config.push_to_hub) == ("cpu", False)
    assert set(config.normalization_mapping.values()) == {NormalizationMode.IDENTITY}
    assert config.get_optimizer_preset().lr == 0.0 and config.get_scheduler_preset() is None
    indices = (config.observation_delta_indices, config.action_delta_indices)
    assert indices == (None, None) and config.reward_delta_indices is None


def test_settings_that_make_no_sense_are_refused(config_class):
    with pytest.raises(ValueError, match="model is 'other': give dsgmr or per_step"):
        config_class(model="other")
    with pytest.raises(ValueError, match=r"needs the features 'observation.state' and 'action'"):
        config_class(input_features={"observation.images.top": "pictures"}).validate_features()
    config_class(
        input_features={"observation.state": 1, "observation.images.top": 2},
        output_features={"action": 1},
    ).validate_features()


def test_the_learner_takes_names_and_frames_per_second_of_the_dataset(config_class):
    config = config_class(frames=["start"], held="part")
    features = {
        "observation.state": {"shape": [2], "names": ["a", "b"]},
        "action": {"shape": [2], "names": ["a", "b"]},
    }
    config.take_names(features, 30)
    assert config.learner == task_model.LearnerSettings(
        frames=["start"],
        held="part",
        fps=30.0,
        state_names=["a", "b"],
        environment_names=[],
        action_names=["a", "b"],
    )
