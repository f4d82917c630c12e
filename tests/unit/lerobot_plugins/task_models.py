"""`task_model` of the policy, imported from its file: its package needs lerobot."""

import importlib.util
import sys

from tests.paths import ROOT

PACKAGE = ROOT / "lerobot_policy_dsgmr" / "lerobot_policy_dsgmr"


def load(name, package=None):
    """A module of the policy under the name that it has when it is installed."""
    full = f"lerobot_policy_dsgmr.{name}"
    spec = importlib.util.spec_from_file_location(full, PACKAGE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[full] = module
    spec.loader.exec_module(module)
    return module


task_model = load("task_model")
