"""The limits of the arm as parameters of the nodes that enforce them."""

from dart_skill_nodes.process.node_base import Parameter

LIMITS = [
    Parameter("careful_elbow", "fastest elbow where nothing is thrown [m/s]", 0.05, 10.0),
    Parameter("careful_hand", "fastest hand where nothing is thrown [m/s]", 0.05, 10.0),
    Parameter("fastest_elbow", "of a throw, and of an arm that a person guides [m/s]", 0.1, 10.0),
    Parameter(
        "fastest_hand",
        "of a throw, and of an arm that a person guides; plans beyond it are refused [m/s]",
        0.1,
        8.0,
    ),
    Parameter(
        "torque_share", "of the peak torque of a joint, gravity compensation included", 0.01, 1.5
    ),
    Parameter(
        "joint_margin",
        "to the end of a joint's range, at which a throw is stopped [rad]",
        0.0,
        0.5,
    ),
    Parameter("joint_overrun", "beyond the end of a joint's range [rad]", 0.001, 1.0),
    Parameter("workspace_low", "lower corner of the box in which the hand stays [m]"),
    Parameter("workspace_high", "its upper corner [m]"),
    Parameter("strongest_force", "wrenches of the commander are cut there [N]", 1.0, 500.0),
    Parameter("strongest_moment", "wrenches of the commander are cut there [N m]", 1.0, 200.0),
    Parameter(
        "human_force", "a person who guides a simulated arm does not push harder [N]", 1.0, 2000.0
    ),
    Parameter(
        "human_moment",
        "a person who guides a simulated arm does not turn harder [N m]",
        1.0,
        500.0,
    ),
    Parameter("warning_share", "of a limit, from which it is warned of", 0.1, 1.0),
    Parameter(
        "patience", "limits of the arm's own safety module, as shares of the commander's", 1.0, 2.0
    ),
]
