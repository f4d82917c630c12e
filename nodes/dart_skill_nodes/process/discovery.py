"""Where the graph is found: on this machine alone, and on a ROS domain. Imported before rclpy starts."""

import os
import socket
from contextlib import closing


def stay_on_this_machine() -> None:
    """Limit discovery to this machine, unless the user chose otherwise. Call before rclpy starts."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def choose_domain() -> None:
    """Set ROS to this machine alone, and to a domain that nobody uses, unless the user chose one. Call before rclpy starts."""
    stay_on_this_machine()
    if "ROS_DOMAIN_ID" in os.environ:
        return
    first = os.getpid() % 100
    for domain in (1 + (first + k) % 100 for k in range(100)):
        if _free(7400 + 250 * domain):
            os.environ["ROS_DOMAIN_ID"] = str(domain)
            return
    raise RuntimeError("no free ROS domain between 1 and 100: set ROS_DOMAIN_ID")


def _free(port: int) -> bool:
    """Whether nobody listens on a domain's discovery port, or on the first ports of its participants."""
    for offset in (0, 10, 11):
        with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
            try:
                probe.bind(("127.0.0.1", port + offset))
            except OSError:
                return False
    return True
