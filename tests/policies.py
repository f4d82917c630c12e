"""What a policy of ROS 2 Security allows, in names of DDS, as SROS 2 translates it."""

from fnmatch import fnmatch
from xml.etree import ElementTree

ACTION_SERVICES = ("send_goal", "cancel_goal", "get_result")


def allowed(policy):
    """Patterns of DDS topics that each enclave of a policy may publish, and may subscribe to."""
    return {
        enclave.get("path"): _of(enclave)
        for enclave in ElementTree.fromstring(policy.split("\n", 1)[1]).iter("enclave")
    }


def may(patterns, name):
    """Whether one of the patterns allows a DDS topic."""
    return any(fnmatch(name, pattern) for pattern in patterns)


def _of(enclave):
    publish, subscribe = {"ros_discovery_info"}, {"ros_discovery_info"}
    for profile in enclave.iter("profile"):
        for rules in profile:
            (rule,) = rules.attrib
            for expression in rules:
                name = expression.text.replace(
                    "~", f"{profile.get('ns').rstrip('/')}/{profile.get('node')}"
                )
                requests, replies = _services(rules.tag, name)
                told = _topics(rules.tag, name)
                asks = rule in ("request", "call")
                publish |= (
                    requests
                    if asks
                    else replies | (told if rule in ("publish", "execute") else set())
                )
                subscribe |= (
                    replies | (told if rule in ("subscribe", "call") else set())
                    if asks or rule == "subscribe"
                    else requests
                )
    return publish, subscribe


def _services(tag, name):
    names = {
        "services": [name],
        "actions": [f"{name}/_action/{one}" for one in ACTION_SERVICES],
    }.get(tag, [])
    return {f"rq{one}Request" for one in names}, {f"rr{one}Reply" for one in names}


def _topics(tag, name):
    return {
        "topics": {f"rt{name}"},
        "actions": {f"rt{name}/_action/{one}" for one in ("feedback", "status")},
    }.get(tag, set())
