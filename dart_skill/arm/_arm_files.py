"""What the files of arms may have: those of config/arms/, and config/wam.yaml, which describes an
arm without a URDF.
"""

from dart_skill.common.entries import ANYTHING, Each, Entries, Number, Rows, Text

NAME = Text(filled=True)
LENGTH, POSITIVE = Number(-10.0, 10.0), Number(1e-9, 1e6)
POINT = Rows(LENGTH, (3,))
ANGLE = Number(-10.0, 10.0)
QUARTERS = Number(-4, 4, whole=True)
WAM_JOINTS = 7
OF_JOINTS = Rows(Number(-1e5, 1e5))
"""A number for each joint; how many these are, the URDF says."""
OF_SEVEN = Rows(Number(-1e5, 1e5), (WAM_JOINTS,))
SWING = Entries(
    {
        "joints": Rows(Number(1, 20, whole=True), (3,)),
        "cocked": Rows(ANGLE, (3,)),
        "release": Rows(ANGLE, (3,)),
        "rates": Rows(Number(-100.0, 100.0), (3,)),
        "duration": Number(0.01, 10.0),
    },
    {"rest": Rows(ANGLE)},
)
"""How a person throws with the arm."""
ARM_FILE = Entries(
    {"urdf": NAME, "base": NAME, "tool": NAME},
    {
        "about": Text(),
        "install": Text(),
        "joints": Rows(NAME),
        "grip": Rows(Number(-2.0, 2.0), (3,)),
        "turn": Number(-7.0, 7.0),
        "mount_height": LENGTH,
        "velocity": Each(Number(1e-6, 100.0)),
        "torque": Each(Number(1e-6, 1e4)),
        "rotor_inertia": Each(Number(1e-6, 100.0)),
        "servo": Each(OF_JOINTS),
        "postures": Each(OF_JOINTS),
        "swing": SWING,
        "parameters": Each(Each(ANYTHING)),
        "skills": Each(Each(ANYTHING)),
    },
)
"""A file of config/arms/."""
_JOINT = Entries(
    {
        **dict.fromkeys(("name", "parent", "child"), NAME),
        "xyz": POINT,
        "roll_quarter_turns": QUARTERS,
        **dict.fromkeys(("lower", "upper"), ANGLE),
        **dict.fromkeys(("peak_torque", "no_load_speed"), POSITIVE),
        **dict.fromkeys(("coulomb_friction", "viscous_friction"), Number(0.0, 1e4)),
    }
)
_MASS = Number(0.0, 1e3)
_INERTIA = Rows(Number(-1e3, 1e3), (6,))
_IN_A_FRAME = Entries({"centre": POINT, "inertia": _INERTIA})
_LINK = Entries({"name": NAME, "mass": _MASS, "urdf": _IN_A_FRAME, "dh": _IN_A_FRAME})
WAM_FILE = Entries(
    {
        "mount_height": LENGTH,
        "shoulder_height": LENGTH,
        "gravity": Number(0.0, 30.0),
        "dh": Rows(
            Entries({"joint": NAME, "alpha_quarter_turns": QUARTERS, "a": LENGTH, "d": LENGTH}),
            (WAM_JOINTS,),
        ),
        "joints": Rows(_JOINT, (WAM_JOINTS,)),
        "tool_plate": Entries({"parent": NAME, "xyz": POINT}),
        "links": Rows(_LINK, (WAM_JOINTS,)),
        "hand": Entries(
            {"mass": _MASS, "centre": POINT, "inertia": _INERTIA, "ball_centre": POINT}
        ),
        "transmission": Entries(
            {
                "joint_to_motor": Rows(OF_SEVEN, (WAM_JOINTS,)),
                "rotor_inertia": Rows(POSITIVE, (WAM_JOINTS,)),
            }
        ),
        "motors": Entries(
            {
                **dict.fromkeys(
                    ("torque_constant", "resistance", "no_load_speed"),
                    Rows(POSITIVE, (WAM_JOINTS,)),
                ),
                "bus_voltage": POSITIVE,
            }
        ),
        "capsules": Rows(
            Entries({"link": NAME, "from": POINT, "to": POINT, "radius": Number(1e-4, 10.0)})
        ),
        "servo": Entries(
            dict.fromkeys(
                ("stiffness", "damping", "limit", "following_stiffness", "following_damping"),
                Rows(Number(0.0, 1e5), (WAM_JOINTS,)),
            )
        ),
        "elbow": Number(1, WAM_JOINTS, whole=True),
        "swing": SWING,
        "poses": Entries(
            {"home": Rows(ANGLE, (WAM_JOINTS,))},
            dict.fromkeys(("bench", "belt"), Rows(ANGLE, (WAM_JOINTS,))),
        ),
    }
)
"""config/wam.yaml."""
