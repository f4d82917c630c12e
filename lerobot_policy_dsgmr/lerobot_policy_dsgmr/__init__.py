"""The policy `dsgmr` of LeRobot, which imports this package because of its name and so registers
the configuration.
"""

from lerobot_policy_dsgmr.configuration_dsgmr import DSGMRConfig

__all__ = ["DSGMRConfig"]
