"""The skill learner: hears demonstrations, or reads them from a bag, learns DS-GMR, and plans on
request.
"""

from itertools import cycle
from typing import Any

import numpy as np
from dart_skill_msgs.msg import Demonstration, DemonstrationMark, DemonstrationStatus
from dart_skill_msgs.srv import (
    AddTrial,
    DropDemonstration,
    Learn,
    ListDemonstrations,
    ModelFile,
    Plan,
)
from geometry_msgs.msg import Point
from rcl_interfaces.msg import SetParametersResult
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.arm import load_registration
from dart_skill.common import palette
from dart_skill.common.words import counted
from dart_skill.recording import (
    Marks,
    demonstration_from_message,
    ids_named,
    read_demonstrations,
    read_dropped,
)
from dart_skill.skills.learning import NoPlan, Unreachable, component_ellipsoids
from dart_skill.skills.practice import TEACH, Learner, Lesson, Standing
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.for_viewers import marker_colour
from dart_skill_nodes.comms.names import DEMONSTRATIONS, MARKS
from dart_skill_nodes.comms.qos import LATCHED, NEWEST, SYSTEM
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import OK, Diagnostics, run
from dart_skill_nodes.process.parameters import declare, skill_of, values_of

COLOURS = tuple(marker_colour(colour, 0.45) for colour in palette.GAUSSIANS)
"""Colours of the product of the frames, and of the frames."""
SHOWN = marker_colour(palette.DEMONSTRATION)
"""Colour of the places for which something was shown."""


class SkillLearner(GuardedNode):
    """Services ~/learn, ~/plan, ~/add_trial, ~/save, ~/load, ~/demonstrations,
    ~/drop_demonstration; Gaussians on ~/model.
    """

    def __init__(self):
        super().__init__("skill_learner")
        self.p = declare(self, "skill_learner")
        self._heard: dict[str, Any] = {}
        self._marked = Marks()
        self._skill = skill_of(self)
        file = self.p["registration_file"]
        registration = load_registration(file) if file else None
        self._learner = Learner(self._skill, self._parameters_now, registration)
        self.add_on_set_parameters_callback(self._check_changes)
        self.create_subscription(Demonstration, DEMONSTRATIONS, self._on_demonstration, LATCHED)
        self.create_subscription(DemonstrationMark, MARKS, self._marked.take, LATCHED)
        self._marks = self.create_publisher(DemonstrationMark, MARKS, LATCHED)
        self._markers = self.create_publisher(MarkerArray, "~/model", NEWEST)
        self.create_service(Learn, "~/learn", self._on_learn)
        self.create_service(ListDemonstrations, "~/demonstrations", self._on_list)
        self.create_service(DropDemonstration, "~/drop_demonstration", self._on_drop)
        self.create_service(Plan, "~/plan", self._on_plan)
        self.create_service(AddTrial, "~/add_trial", self._on_add_trial)
        self.create_service(ModelFile, "~/save", self._on_save)
        self.create_service(ModelFile, "~/load", self._on_load)
        self._diagnostics = Diagnostics(self, self._describe)

    def _parameters_now(self) -> dict[str, Any]:
        return values_of(self, self.p)

    def _on_demonstration(self, message: Demonstration) -> None:
        one = self._checked(message)
        self._heard[one.id] = one
        self._learner.expect(one)

    def _checked(self, message: Demonstration) -> Any:
        self._check_frame(message.id or "the demonstration", message)
        return demonstration_from_message(message, self._skill.name)

    def _check_frame(self, what: str, message) -> None:
        if message.header.frame_id != self.p["frame_id"]:
            raise ValueError(
                f"{what} is in frame '{message.header.frame_id}', not '{self.p['frame_id']}'"
            )

    def _check_changes(self, parameters: list) -> SetParametersResult:
        try:
            self._learner.check(
                self._parameters_now() | {one.name: one.value for one in parameters}
            )
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    # services

    def _on_learn(self, request, response):
        response.pending = not request.bag and len(self._heard) < request.at_least
        if response.pending:
            response.message = (
                f"{len(self._heard)} of {request.at_least} demonstrations have been heard so far:"
                " dart-skill teach --count 5 shows some"
            )
            return response
        try:
            lesson, dropped = self._learn_from(request.bag, request.without, request.configuration)
        except (ValueError, OSError) as error:
            self.get_logger().error(f"nothing learned: {error}")
            raise
        response.demonstrations = len(lesson.learned_from)
        response.model_id = lesson.model_id
        left_out = [f"left out: {reason}" for reason in lesson.left_out.values()]
        said = [lesson.said, *lesson.facts, *left_out]
        said += [f"dropped: {', '.join(dropped)}"] if dropped else []
        response.message = "; ".join(said)
        for reason in left_out:
            self.get_logger().warning(reason)
        self._publish_markers()

    def _learn_from(
        self, bag: str, without: list[str], configuration: str
    ) -> tuple[Lesson, list[str]]:
        """Learn from a bag, or from what was heard, but for what was dropped; the ids of that."""
        heard = read_demonstrations(bag, self._skill.name) if bag else list(self._heard.values())
        without = ids_named(without, [one.id for one in heard], bag or "the learner")
        out = (read_dropped(bag) if bag else self._marked.dropped) | set(without)
        lesson = self._learner.learn([one for one in heard if one.id not in out], configuration)
        return lesson, [one.id for one in heard if one.id in out]

    def _on_list(self, request, response):
        compared = self._learner.standings() if request.compare else {}
        of = {"configuration": request.configuration} if request.configuration else {}
        self._learner.check(self._parameters_now() | of)
        response.demonstrations = [
            self._status(one, request.configuration, compared) for one in self._heard.values()
        ]
        dropped = sum(one.dropped for one in response.demonstrations)
        response.message = (
            f"{counted(len(self._heard), 'demonstration')}, {dropped} of them dropped"
        )

    def _status(
        self, one: Any, configuration: str, compared: dict[str, Standing]
    ) -> DemonstrationStatus:
        counts = compared.get(one.id, Standing(float("nan")))
        status = DemonstrationStatus(
            skill=self._skill.name, id=one.id, dropped=one.id in self._marked.dropped
        )
        status.weight, status.unlike, status.outlier = counts.weight, counts.unlike, counts.outlier
        try:
            shown = self._skill.described(one)
            start, stop = np.nan_to_num([shown.motion_start, shown.motion_stop]).tolist()
            status.header.frame_id = one.frame_id
            status.header.stamp = conversions.time_msg(one.stamp_ns + round(1e9 * start))
            status.duration = conversions.duration_msg(stop - start)
            status.situation = conversions.situation_msg(shown.situation)
            status.readable, status.finding = True, self._learner.finding(one, configuration)
        except ValueError as error:
            status.readable, status.finding = False, str(error)
        return status

    def _on_drop(self, request, response):
        try:
            (name,) = ids_named([request.id], list(self._heard), "the learner")
        except ValueError as error:
            raise ValueError(f"{error}: see dart-skill demonstrations") from error
        mark = DemonstrationMark(id=name, dropped=not request.restore)
        mark.header.stamp = SYSTEM.now().to_msg()
        self._marked.take(mark)
        self._marks.publish(mark)
        what = "counts again" if request.restore else "is dropped"
        response.message = f"{name} {what}: learn again (dart-skill learn)"

    def _on_plan(self, request, response):
        try:
            if request.header.frame_id:
                self._check_frame("the situation", request)
            asked = conversions.asked(request.situation, self._skill)
            planned = self._learner.plan(asked, request.explore)
        except ValueError as error:
            response.unreachable = isinstance(error, Unreachable | NoPlan)
            raise
        response.plan = conversions.planned_msg(planned, self.p["frame_id"], self._skill)
        response.held = conversions.situation_msg(planned.held)

    def _on_add_trial(self, request, response):
        response.left = [float("nan")] * 2
        self._check_learned(TEACH)
        plan = None
        if self._learner.needs_plan and request.plan.trajectory.points:
            plan = conversions.throw_plan(request.plan, self._skill)
        taken = self._learner.tell(self._checked(request.trial), plan)
        response.success, response.message = taken.kept, taken.message
        response.left, response.demonstrations = taken.left, taken.demonstrations
        self._publish_markers()
        return response

    def _check_learned(self, remedy: str) -> None:
        if not self._learner.learned:
            raise ValueError(f"nothing is learned yet: {remedy}")

    def _on_save(self, request, response):
        self._check_learned("there is no model to save")
        response.model_id = self._learner.save(request.path)

    def _on_load(self, request, response):
        response.model_id = self._learner.load(request.path)
        self._publish_markers()

    # what is shown

    def _publish_markers(self) -> None:
        array = MarkerArray(markers=[Marker(action=Marker.DELETEALL)])
        groups, places = self._learner.mixtures()
        for colour, (name, mixture) in zip(cycle(COLOURS), groups.items(), strict=False):
            for k, (position, orientation, size) in enumerate(
                component_ellipsoids(mixture, angles=self._learner.angles)
            ):
                marker = Marker(ns=name, id=k, type=Marker.SPHERE, action=Marker.ADD, color=colour)
                marker.header.frame_id = self.p["frame_id"]
                conversions.set_pose(marker.pose, position, orientation)
                conversions.set_vector(marker.scale, size)
                array.markers.append(marker)
        targets = Marker(ns="targets", id=0, type=Marker.SPHERE_LIST, action=Marker.ADD)
        targets.header.frame_id = self.p["frame_id"]
        targets.scale.x = targets.scale.y = targets.scale.z = 0.05
        targets.color = SHOWN
        targets.points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in places]
        array.markers.append(targets)
        self._markers.publish(array)

    def _describe(self):
        if not self._learner.learned:
            return OK, "nothing learned yet", {"heard": len(self._heard)}
        return OK, "ready to plan", {"heard": len(self._heard), **self._learner.values()}


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill skill_learner`."""
    run(lambda: [SkillLearner()], args)


if __name__ == "__main__":
    main()
