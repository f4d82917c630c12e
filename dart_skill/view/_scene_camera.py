"""Pictures of arm and bodies without a screen: what a camera that looks at the scene would see,
for videos of datasets.

PyBullet draws them with its software renderer, so that no graphics card is needed. Bodies look as
in the live view.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dart_skill.arm import the_arm, write_urdf
from dart_skill.common import palette
from dart_skill.simulation import Basket, connect
from dart_skill.skills.protocol import Skill
from dart_skill.view.shapes import ColouredMesh, bucket, parts_of, sphere

FAR_VIEW = (1.0, -3.9, 2.4), (0.85, 0.0, 0.85)
"""Position of the camera of a throw and the point to which it looks [m]."""
BENCH_VIEW = (1.75, -1.35, 1.95), (0.55, 0.0, 1.15)
"""Position of the camera of work within reach and the point to which it looks [m]."""
ANGLE = 46.0
"""Vertical angle of view [deg]."""
LIGHT_FROM = (2.0, -3.0, 5.0)
"""Position of the lamp [m]."""
NEAR = 0.05
"""Distance of the nearest thing that is drawn [m]."""
FAR = 20.0
"""Distance of the farthest thing that is drawn [m]."""
WIDTH = 320
"""Width of a picture [pixels]."""
HEIGHT = 240
"""Height of a picture [pixels]."""
AWAY = (0.0, 0.0, -50.0)
"""Position of a body that was not seen yet, out of sight [m]."""


class SceneCamera:
    """A camera in front of the arm; a maker of pictures for `write_lerobot`.

    Parameters
    ----------
    skill
        Whose bodies are in the scene.
    width, height
        Of the pictures [pixels].
    """

    def __init__(self, skill: Skill, width: int = WIDTH, height: int = HEIGHT):
        self.width, self.height = width, height
        self._client = client = connect()
        description = skill.loaded(the_arm())
        self._arm = self._add_arm(write_urdf(description, shapes=True), description.mount_height)
        self._joints = [
            k
            for k in range(client.getNumJoints(self._arm))
            if client.getJointInfo(self._arm, k)[2] == client.JOINT_REVOLUTE
        ]
        self._add_still(description.mount_height)
        for solid in skill.surroundings():
            self._body(parts_of([solid]), palette.LIGHT)
        self._bodies = {
            role: self._body(
                _parts(skill, role), palette.BALL if role == skill.moves else palette.BASKET, AWAY
            )
            for role in skill.bodies
        }
        far = skill.world in ("basket", "board")
        view = FAR_VIEW if far else BENCH_VIEW
        self._view = client.computeViewMatrix(*view, (0.0, 0.0, 1.0))
        self._projection = client.computeProjectionMatrixFOV(ANGLE, width / height, NEAR, FAR)

    def picture(
        self, joint_position: np.ndarray, poses: Mapping[str, tuple[np.ndarray, np.ndarray]]
    ) -> np.ndarray:
        """(height, width, 3), uint8, of joints at (7,) [rad] and bodies at their positions (3,)
        [m] and quaternions (4,), by role.
        """
        client = self._client
        for joint, angle in zip(
            self._joints, np.asarray(joint_position, dtype=float), strict=True
        ):
            client.resetJointState(self._arm, joint, float(angle))
        for role, (position, quaternion) in poses.items():
            client.resetBasePositionAndOrientation(
                self._bodies[role], list(map(float, position)), list(map(float, quaternion))
            )
        seen = client.getCameraImage(
            self.width, self.height, self._view, self._projection, lightDirection=LIGHT_FROM, shadow=0,
            renderer=client.ER_TINY_RENDERER,
        )  # fmt: skip
        return np.array(seen[2], dtype=np.uint8).reshape(self.height, self.width, 4)[:, :, :3]

    def close(self) -> None:
        self._client.disconnect()

    def _add_arm(self, urdf: str, height: float) -> int:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(urdf, encoding="utf-8")
            arm = self._client.loadURDF(str(path), [0.0, 0.0, height], useFixedBase=True)
        for shape in self._client.getVisualShapeData(arm):
            link = self._client.getJointInfo(arm, shape[1])[12].decode() if shape[1] >= 0 else ""
            self._client.changeVisualShape(
                arm,
                shape[1],
                rgbaColor=_rgba(palette.FINGERS if link.startswith("bhand") else palette.ARM),
            )
        return arm

    def _add_still(self, height: float) -> None:
        """Floor and pedestal."""
        client = self._client
        floor = client.createVisualShape(
            client.GEOM_BOX, halfExtents=[6.0, 6.0, 0.01], rgbaColor=_rgba((225, 225, 228))
        )
        client.createMultiBody(0, -1, floor, [0.0, 0.0, -0.01])
        mount = client.createVisualShape(
            client.GEOM_CYLINDER, radius=0.12, length=height, rgbaColor=_rgba(palette.LIGHT)
        )
        client.createMultiBody(0, -1, mount, [0.0, 0.0, height / 2])

    def _body(
        self,
        parts: list[ColouredMesh],
        colour: tuple[int, int, int],
        position: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> int:
        """A body of several meshes, each a link that is fixed to the first one."""
        client, shapes = self._client, [self._shape(part, colour) for part in parts]
        n, zeros, unturned = len(shapes) - 1, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]
        return client.createMultiBody(
            0, -1, shapes[0], position, linkMasses=[0] * n, linkCollisionShapeIndices=[-1] * n, linkVisualShapeIndices=shapes[1:],
            linkPositions=[zeros] * n, linkOrientations=[unturned] * n, linkInertialFramePositions=[zeros] * n,
            linkInertialFrameOrientations=[unturned] * n, linkParentIndices=[0] * n, linkJointTypes=[client.JOINT_FIXED] * n,
            linkJointAxis=[[0.0, 0.0, 1.0]] * n,
        )  # fmt: skip

    def _shape(self, part: ColouredMesh, colour: tuple[int, int, int]) -> int:
        vertices, faces = part.mesh.vertices.tolist(), part.mesh.faces
        both = np.concatenate([faces, faces[:, ::-1]]).ravel().tolist()  # a bucket is looked into
        return self._client.createVisualShape(
            self._client.GEOM_MESH,
            vertices=vertices,
            indices=both,
            rgbaColor=_rgba(part.colour or colour),
        )


def _parts(skill: Skill, role: str) -> list[ColouredMesh]:
    if skill.in_the_open and role == "ball":
        return [ColouredMesh(sphere(the_arm().ball.radius))]
    if skill.in_the_open:
        shape = Basket()
        return [ColouredMesh(bucket(shape.radius, shape.depth, shape.wall))]
    return parts_of(skill.solids(role))


def _rgba(colour: tuple[int, int, int]) -> list[float]:
    return [*(part / 255.0 for part in colour), 1.0]
