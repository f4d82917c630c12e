"""Published numbers of the Barrett WAM with BH8-280 hand, and kinematics and gravity computed from
them with numpy alone.

Kinematics, masses and transmission: BarrettTechnology/libbarrett, config/wam7w.conf, commit
109faf60. Motors: Barrett's support wiki. Hand: support.barrett.com by way of herb_description.
Friction: personalrobotics/owd. SI units.
"""

import numpy as np

JOINTS = tuple(f"wam_j{number}" for number in range(1, 8))
QUARTER = np.pi / 2
DH = np.array(
    [
        [-QUARTER, 0.0, 0.0],
        [QUARTER, 0.0, 0.0],
        [-QUARTER, 0.045, 0.55],
        [QUARTER, -0.045, 0.0],
        [-QUARTER, 0.0, 0.3],
        [QUARTER, 0.0, 0.0],
        [0.0, 0.0, 0.0609],
    ]
)
"""alpha, a, d (7, 3), distal convention: RotZ(theta) TransZ(d) TransX(a) RotX(alpha) [rad, m]."""
SHOULDER_HEIGHT = 0.346
"""From the base's mounting plane to the shoulder centre (jhu-lcsr/barrett_model) [m]."""
GRAVITY = 9.81
MASS = np.array([10.7677, 3.8749, 1.8023, 2.17266212, 0.35655692, 0.40915886, 0.0754827])
CENTRE = np.array(
    [
        [-0.00443, 0.12189, -0.00066],
        [-0.00237, 0.03106, 0.01542],
        [-0.03826, 0.20751, 0.00003],
        [0.00553408, 0.00006822, 0.11927695],
        [0.00005483, 0.02886286, 0.00148493],
        [-0.00005923, -0.01686123, 0.02419052],
        [0.00014836, 0.00007252, -0.00335185],
    ]
)
"""Centres of mass in the distal DH frames (7, 3) [m]."""
PRINTED_INERTIA = np.array(
    [
        [0.13488033, -0.00213041, -0.00012485, 0.11328369, 0.00068555, 0.09046330],
        [0.02140958, 0.00027172, 0.00002461, 0.01377875, -0.00181920, 0.01558906],
        [0.05911077, -0.00249612, 0.00000738, 0.00324550, -0.00001767, 0.05927043],
        [0.01067491, 0.00004503, -0.00135557, 0.01058659, -0.00011002, 0.00282036],
        [0.00037112, -0.00000008, -0.00000003, 0.00019434, -0.00001613, 0.00038209],
        [0.00054889, 0.00000019, -0.00000010, 0.00023846, -0.00004430, 0.00045133],
        [0.00003911, 0.00000019, 0.0, 0.00003877, 0.0, 0.00007614],
    ]
)
"""Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centres of mass as printed (7, 6): products with the sign
of +int(xy dm) [kg m^2].
"""

LOWER = np.array([-2.6, -2.0, -2.8, -0.9, -4.76, -1.6, -3.0])
UPPER = np.array([2.6, 2.0, 2.8, 3.14, 1.24, 1.6, 3.0])
"""Ends of the joints' ranges: manual, table 6, and the home pose of J4 [rad]."""
COULOMB = np.array([2.7, 2.5, 1.5, 1.1, 0.4, 0.4, 0.1])
VISCOUS = np.array([1.5, 0.9, 0.5, 0.25, 0.016, 0.1, 0.0027])
"""Joint friction (7,): identified by owd; viscous of J5 and J7 from the motors [N m, N m s/rad].
"""

JOINT_TO_MOTOR = np.zeros((7, 7))
JOINT_TO_MOTOR[[0, 3, 6], [0, 3, 6]] = -42.0, -18.0, -14.93
JOINT_TO_MOTOR[1:3, 1:3] = [[28.25, -16.8155], [-28.25, -16.8155]]
JOINT_TO_MOTOR[4:6, 4:6] = [[9.7, -9.7], [9.7, 9.7]]
ROTOR_INERTIA = np.array([11.631, 11.831, 11.831, 10.686, 1.685, 1.745, 0.142]) * 1e-5
"""Motor and pulley at the rotor (7,), Barrett AC-02 [kg m^2]."""
TORQUE_CONSTANT = np.array([0.457] * 4 + [0.236] * 2 + [0.067])
RESISTANCE = np.array([3.473] * 4 + [6.213] * 2 + [5.205])
NO_LOAD_SPEED = np.array([100.218] * 4 + [192.309] * 2 + [569.022])
BUS_VOLTAGE = 48.0
PUCK_PEAK_JOINT = np.array([82.1, 109.5, 65.2, 31.2, 12.4, 12.4, 2.2])
"""Peak torques at the joints that the motor controllers allow (7,): derived from owd [N m]."""
SPEED_FILTER = 180.0
"""Corner of libbarrett's low-pass of differenced positions [rad/s]."""

HAND_MASS = 1.202157
HAND_CENTRE = np.array([-0.000022, -0.009457, 0.065545])
HAND_INERTIA = np.array(
    [3.80754648e-3, 3.77174367e-6, -3.83721486e-6, 2.75084711e-3, 3.12076618e-4, 2.14983398e-3]
)
"""Closed on a ball, lumped, in the frame of the mounting face; products with the sign of -int(xy
dm).
"""
FINGER_MASS = 0.062139 + 0.04166
"""Inner link and tip of one finger (BH8-280) [kg]."""
PALM_HEIGHT, PALM_RADIUS = 0.08, 0.0445
BALL_CENTRE = np.array([0.0, 0.0, 0.1135])
BALL_RADIUS = 0.0335


def tensor(six, sign=1.0):
    """Symmetric tensor (3, 3) of xx, xy, xz, yy, yz, zz; `sign` goes to the products."""
    xx, xy, xz, yy, yz, zz = six
    xy, xz, yz = sign * xy, sign * xz, sign * yz
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def about_x(angle):
    """Rotation about x (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_z(angle):
    """Rotation about z (3, 3), or (n, 3, 3) of angles (n,)."""
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros_like(np.asarray(angle, float))
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, zero + 1.0]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def reflected_inertia():
    """Rotor inertia at the joints (7,): the diagonal, its only other entry is 6e-5 between J5 and
    J6 [kg m^2].
    """
    return np.diag(JOINT_TO_MOTOR.T @ np.diag(ROTOR_INERTIA) @ JOINT_TO_MOTOR)


def frames(angles):
    """Rotations (n, 8, 3, 3) and origins (n, 8, 3) of the DH frames 0 to 7 from the shoulder
    centre, for joint angles (n, 7).

    Without n for one posture (7,).
    """
    postures = np.atleast_2d(np.asarray(angles, float))
    rotations = [np.broadcast_to(np.eye(3), (len(postures), 3, 3))]
    origins = [np.zeros((len(postures), 3))]
    for angle, (alpha, a, d) in zip(postures.T, DH, strict=True):
        turned = rotations[-1] @ about_z(angle)
        origins.append(origins[-1] + turned @ [a, 0.0, d])
        rotations.append(turned @ about_x(alpha))
    rotations, origins = np.stack(rotations, axis=1), np.stack(origins, axis=1)
    return (rotations[0], origins[0]) if np.ndim(angles) == 1 else (rotations, origins)


def gravity_torque(angles, masses=MASS, hand_mass=HAND_MASS):
    """Joint torques (7,) that hold arm and hand still in the posture (7,), from the table alone [N
    m].
    """
    rotations, origins = frames(angles)
    centres = origins[1:] + np.einsum("jab,jb->ja", rotations[1:], CENTRE)
    hand = origins[7] + rotations[7] @ HAND_CENTRE
    centres, masses = np.vstack([centres, hand]), np.append(masses, hand_mass)
    torques = np.zeros(7)
    for joint in range(7):
        lever = np.cross(rotations[joint, :, 2], centres[joint:] - origins[joint])
        torques[joint] = GRAVITY * masses[joint:] @ lever[:, 2]
    return torques
