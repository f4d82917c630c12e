"""The files for RViz and Foxglove name topics that nodes publish, of types that the displays take."""

import json
import re

import yaml

from tests.paths import ROOT

VIEWERS = ROOT / "config" / "viewers"
POSES = {f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")}
PUBLISHED = {"/robot_description", "/joint_states", "/diagnostics", *POSES}


def private_topics():
    """What nodes publish below their own names, as their sources say."""
    for file in (ROOT / "nodes" / "dart_skill_nodes" / "executables").glob("*.py"):
        for name in re.findall(r'create_publisher\(\w+, "~/(\w+)"', file.read_text()):
            yield f"/{file.stem}/{name}"


def test_rviz_shows_topics_that_there_are():
    described = yaml.safe_load((VIEWERS / "throwing.rviz").read_text())["Visualization Manager"]
    displays = [display for display in described["Displays"] if "Topic" in display or "Description Topic" in display]
    topics = {display.get("Topic", display.get("Description Topic"))["Value"] for display in displays}
    assert len(topics) == len(displays) and topics <= PUBLISHED | set(private_topics())
    assert described["Global Options"]["Fixed Frame"] == "world"


def test_foxglove_shows_topics_that_there_are_and_every_panel_is_placed():
    layout = json.loads((VIEWERS / "foxglove.json").read_text())
    panels = layout["configById"]
    topics = set(panels["3D!arm"]["topics"])
    for panel in ("Plot!joints", "Plot!ball"):
        topics |= {re.split(r"\.(?:position|pose)", path["value"])[0] for path in panels[panel]["paths"]}
    assert topics <= PUBLISHED | set(private_topics())

    def placed(node):
        return {node} if isinstance(node, str) else placed(node["first"]) | placed(node["second"])

    assert placed(layout["layout"]) == set(panels)
