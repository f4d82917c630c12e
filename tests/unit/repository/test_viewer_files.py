"""The files for RViz, Foxglove and PlotJuggler name topics that nodes publish, of types that the
displays take.
"""

import json
import re
from xml.etree import ElementTree

import yaml

from dart_skill.recording import BagReader
from tests.paths import BAGS, ROOT

VIEWERS = ROOT / "config" / "viewers"
POSES = {f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")}
PUBLISHED = {"/robot_description", "/joint_states", "/diagnostics", *POSES}


RVIZ = {"RobotModel": "std_msgs/msg/String", "Pose": "geometry_msgs/msg/PoseStamped"}
RVIZ |= {"MarkerArray": "visualization_msgs/msg/MarkerArray", "Path": "nav_msgs/msg/Path"}
"""What each display of rviz_default_plugins subscribes to."""


def source_of(node):
    """Of a node, and of what it has from `arm`."""
    nodes = ROOT / "nodes"
    text = (nodes / "dart_skill_nodes" / "executables" / f"{node}.py").read_text()
    parts = re.findall(r"from (dart_skill_nodes\.arm\.\w+) import", text)
    return text + "".join((nodes / f"{part.replace('.', '/')}.py").read_text() for part in parts)


def type_of(topic):
    """Of a topic: as our bags have it, or as the source of its node says."""
    with BagReader(BAGS / "throws") as bag:
        if topic in bag.topics:
            return bag.topics[topic].type_name
    node, name = topic.removeprefix("/").split("/")
    source = source_of(node)
    (kind,) = re.findall(rf'create_publisher\((\w+), "~/{name}"', source)
    (package,) = re.findall(rf"from (\w+)\.msg import .*\b{kind}\b", source)
    return f"{package}/msg/{kind}"


def private_topics():
    """What nodes publish below their own names, as their sources say."""
    for file in (ROOT / "nodes" / "dart_skill_nodes" / "executables").glob("*.py"):
        for name in re.findall(r'create_publisher\(\w+, "~/(\w+)"', source_of(file.stem)):
            yield f"/{file.stem}/{name}"


def test_rviz_shows_topics_that_there_are():
    described = yaml.safe_load((VIEWERS / "throwing.rviz").read_text())["Visualization Manager"]
    displays = [
        display
        for display in described["Displays"]
        if "Topic" in display or "Description Topic" in display
    ]
    topics = {
        display.get("Topic", display.get("Description Topic"))["Value"] for display in displays
    }
    assert len(topics) == len(displays) and topics <= PUBLISHED | set(private_topics())
    assert described["Global Options"]["Fixed Frame"] == "world"


def test_rviz_is_given_the_types_that_its_displays_take():
    displays = yaml.safe_load((VIEWERS / "throwing.rviz").read_text())["Visualization Manager"][
        "Displays"
    ]
    for display in displays:
        kind, topic = (
            display["Class"].split("/")[1],
            display.get("Topic", display.get("Description Topic")),
        )
        if topic is not None:
            assert type_of(topic["Value"]) == RVIZ[kind], display["Name"]


def series_of(topic, frame):
    """Names of the curves that PlotJuggler 3 makes of a topic: the path of each number; of joint
    states by the names of the joints.
    """
    numbers = [name for name in frame.columns if frame[name].dtype.kind in "fiu"]
    if "name[0]" not in frame:
        return {f"{topic}/{name.replace('.', '/')}" for name in numbers}
    fields = [re.fullmatch(r"(\w+)\[(\d+)\]", name) for name in numbers]
    return {f"{topic}/{frame[f'name[{one[2]}]'].iloc[0]}/{one[1]}" for one in fields if one}


def test_plotjuggler_plots_curves_that_there_are():
    root = ElementTree.parse(VIEWERS / "plotjuggler.xml").getroot()
    curves = {curve.get("name") for curve in root.iter("curve")}
    assert [tab.get("tab_name") for tab in root.iter("Tab")] == ["joints", "throw"] and len(
        curves
    ) == 3 * 7 + 4 * 3
    there = set()
    with BagReader(BAGS / "demonstrations") as bag:
        for topic in (
            "/joint_states",
            "/vrpn_mocap/hand/pose",
            "/vrpn_mocap/ball/pose",
            "/wam/command",
            "/wam/teacher_wrench",
        ):
            there |= series_of(topic, bag.to_pandas(topic, stop_ns=bag.start_ns + 10**9))
    assert curves <= there
    for splitter in root.iter("DockSplitter"):
        assert (
            len(splitter.get("sizes").split(";"))
            == int(splitter.get("count"))
            == len(list(splitter))
        )


def test_foxglove_shows_topics_that_there_are_and_every_panel_is_placed():
    layout = json.loads((VIEWERS / "foxglove.json").read_text())
    panels = layout["configById"]
    topics = set(panels["3D!arm"]["topics"])
    for panel in ("Plot!joints", "Plot!ball"):
        topics |= {
            re.split(r"\.(?:position|pose)", path["value"])[0] for path in panels[panel]["paths"]
        }
    assert topics <= PUBLISHED | set(private_topics())

    def placed(node):
        return {node} if isinstance(node, str) else placed(node["first"]) | placed(node["second"])

    assert placed(layout["layout"]) == set(panels)
