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

from dart_skill.arm import ThrowPlan, load_registration
from dart_skill.common import palette
from dart_skill.recording import (
    BagError,
    Marks,
    check_known,
    demonstration_from_message,
    read_demonstrations,
    read_dropped,
)
from dart_skill.skills.learning import NoPlan, Unreachable, component_ellipsoids
from dart_skill.skills.practice import Learner, Lesson, Standing
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.markers import marker_colour
from dart_skill_nodes.comms.names import DEMONSTRATIONS, MARKS
from dart_skill_nodes.comms.qos import LATCHED, NEWEST, SYSTEM
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import OK, Diagnostics, Parameter, declare, run, skill_of

TABLE = [
    Parameter("skill", "that it learns"),
    Parameter("frame_id", "frame of demonstrations and plans"),
    Parameter("configuration", "name of the skill's configuration"),
    Parameter(
        "practice_method", "how to learn from own throws: residual, bootstrap, both, power or none"
    ),
    Parameter(
        "practice_capacity", "demonstrations and trials that are remembered, 0: all", 0, 100_000
    ),
    Parameter("practice_forget", "which trial goes when the memory is full: oldest or crowded"),
    Parameter(
        "components",
        "of the mixture, in place of the configuration's; 0: as it has it",
        0,
        100,
        read_only=False,
    ),
    Parameter(
        "choose_components",
        "bic or cross_validation: how the number of components is chosen; empty: it is given",
        read_only=False,
    ),
    Parameter(
        "frames",
        "task frames in place of the configuration's, or those of a skill that count; empty: all",
        read_only=False,
    ),
    Parameter(
        "stiffness",
        "of a plan per unit mass [1/s^2]; 0: as the configuration has it",
        0.0,
        5000.0,
        read_only=False,
    ),
    Parameter(
        "orientation_stiffness",
        "the same of the orientation; 0: as the configuration has it",
        0.0,
        5000.0,
        read_only=False,
    ),
    Parameter(
        "least_stiffness",
        "of the position where demonstrations varied; unless both are given it is constant",
        0.0,
        5000.0,
        read_only=False,
    ),
    Parameter(
        "most_stiffness",
        "of the position where demonstrations agreed",
        0.0,
        5000.0,
        read_only=False,
    ),
    Parameter(
        "start_speed",
        "the hand moves above it [m/s]; 0: as the skill has it; not of throws",
        0.0,
        10.0,
        read_only=False,
    ),
    Parameter(
        "stop_speed",
        "and rests below it [m/s]; 0: as the skill has it; not of throws",
        0.0,
        10.0,
        read_only=False,
    ),
    Parameter(
        "registration_file",
        "cameras and arm as `dart-skill check arm --write` measured them; empty: told from the"
        " throws alone",
    ),
]

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
        self.p = declare(self, "skill_learner.yaml", TABLE)
        self._heard: dict[str, Any] = {}
        self._marked = Marks()
        self._skill = skill_of(self)
        self._learner = self._make_learner()
        self.add_on_set_parameters_callback(self._check_changes)
        self.create_subscription(Demonstration, DEMONSTRATIONS, self._on_demonstration, LATCHED)
        self.create_subscription(DemonstrationMark, MARKS, self._on_mark, LATCHED)
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

    def _make_learner(self) -> Learner:
        registration = (
            load_registration(self.p["registration_file"]) if self.p["registration_file"] else None
        )
        return Learner(self._skill, self._parameters_now, registration)

    def _parameters_now(self) -> dict[str, Any]:
        return {row.name: self.get_parameter(row.name).value for row in TABLE}

    def _on_demonstration(self, message: Demonstration) -> None:
        try:
            one = self._checked(message)
        except ValueError as error:
            self.get_logger().error(f"a demonstration is left out: {error}")
            return
        self._heard[one.id] = one
        self._learner.expect(one)

    def _on_mark(self, mark: DemonstrationMark) -> None:
        self._marked.take(mark)

    def _checked(self, message: Demonstration) -> Any:
        self._check_frame(message)
        return demonstration_from_message(message, self._skill.name)

    def _check_frame(self, message: Demonstration) -> None:
        if message.header.frame_id != self.p["frame_id"]:
            raise ValueError(
                f"{message.id} is in frame '{message.header.frame_id}', not '{self.p['frame_id']}'"
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
        try:
            response.pending = not request.bag and len(self._heard) < request.at_least
            if response.pending:
                response.message = (
                    f"{len(self._heard)} of {request.at_least} demonstrations have been heard"
                    " so far"
                )
                return response
            lesson, dropped = self._learn_from(request.bag, request.without, request.configuration)
        except (ValueError, BagError, OSError) as error:
            response.success, response.message = False, str(error)
            self.get_logger().error(f"nothing learned: {error}")
            return response
        response.success, response.demonstrations, response.model_id = (
            True,
            len(lesson.learned_from),
            lesson.model_id,
        )
        left_out = [f"left out: {reason}" for reason in lesson.left_out.values()]
        response.message = "; ".join(
            [
                lesson.said,
                *lesson.facts,
                *left_out,
                *([f"dropped: {', '.join(dropped)}"] if dropped else []),
            ]
        )
        for reason in left_out:
            self.get_logger().warning(reason)
        self._publish_markers()
        return response

    def _learn_from(
        self, bag: str, without: list[str], configuration: str
    ) -> tuple[Lesson, list[str]]:
        """Learn from a bag, or from what was heard, but for what was dropped; the ids of that."""
        heard = read_demonstrations(bag, self._skill.name) if bag else self._in_order()
        check_known(without, [one.id for one in heard], bag or "the learner")
        marked = read_dropped(bag) if bag else self._marked.dropped
        out = marked | set(without)
        lesson = self._learner.learn([one for one in heard if one.id not in out], configuration)
        return lesson, [one.id for one in heard if one.id in out]

    def _in_order(self) -> list[Any]:
        """What was heard, as it came."""
        return list(self._heard.values())

    def _on_list(self, request, response):
        try:
            compared = self._learner.standings() if request.compare else {}
            response.demonstrations = [
                self._status(one, request.configuration, compared) for one in self._in_order()
            ]
            self._learner.check(
                self._parameters_now()
                | ({"configuration": request.configuration} if request.configuration else {})
            )
        except ValueError as error:
            response.success, response.message, response.demonstrations = False, str(error), []
            return response
        dropped = sum(one.dropped for one in response.demonstrations)
        response.success, response.message = (
            True,
            f"{len(self._heard)} demonstrations, {dropped} of them dropped",
        )
        return response

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
            duration = float(np.nan_to_num(shown.motion_stop - shown.motion_start))
            status.header.frame_id = one.frame_id
            begun = one.stamp_ns + round(1e9 * float(np.nan_to_num(shown.motion_start)))
            conversions.set_stamp(status.header.stamp, begun)
            status.duration = conversions.duration_msg(duration)
            status.situation = conversions.situation_msg(shown.situation)
            status.readable, status.finding = True, self._learner.finding(one, configuration)
        except ValueError as error:
            status.readable, status.finding = False, str(error)
        return status

    def _on_drop(self, request, response):
        try:
            check_known([request.id], list(self._heard), "the learner")
        except ValueError as error:
            response.success, response.message = False, f"{error}: see dart-skill demonstrations"
            return response
        mark = DemonstrationMark(id=request.id, dropped=not request.restore)
        mark.header.stamp = SYSTEM.now().to_msg()
        self._marked.take(mark)
        self._marks.publish(mark)
        what = "counts again" if request.restore else "is dropped"
        response.success, response.message = (
            True,
            f"{request.id} {what}: learn again (dart-skill learn)",
        )
        return response

    def _on_plan(self, request, response):
        try:
            if request.header.frame_id != self.p["frame_id"]:
                raise ValueError(
                    f"the situation is in frame '{request.header.frame_id}', not"
                    f" '{self.p['frame_id']}'"
                )
            asked = conversions.asked(request.situation, self._skill)
            planned = self._learner.plan(asked, request.explore)
            response.plan = conversions.planned_msg(planned, self.p["frame_id"], self._skill)
            response.held = conversions.situation_msg(planned.held)
            response.success = True
        except ValueError as error:
            response.success, response.unreachable, response.message = (
                False,
                isinstance(error, Unreachable | NoPlan),
                str(error),
            )
        return response

    def _on_add_trial(self, request, response):
        response.left = [float("nan")] * 2
        try:
            if not self._learner.learned:
                raise ValueError(
                    "nothing is learned yet: call ~/learn, or ~/load a model, before trials are"
                    " added"
                )
            plan = self._carried_out(request)
            taken = self._learner.tell(self._checked(request.trial), plan)
            response.success, response.message, response.left = (
                taken.kept,
                taken.message,
                taken.left,
            )
            response.demonstrations = taken.demonstrations
            self._publish_markers()
        except ValueError as error:
            response.success, response.message = False, str(error)
        return response

    def _carried_out(self, request) -> ThrowPlan | None:
        """The plan of a trial, where the learner needs it and the trial had one."""
        if not (self._learner.needs_plan and request.plan.trajectory.points):
            return None
        return conversions.throw_plan(request.plan, self._skill)

    def _on_save(self, request, response):
        try:
            if not self._learner.learned:
                raise ValueError("nothing is learned yet: there is no model to save")
            response.model_id, response.success = self._learner.save(request.path), True
        except (ValueError, OSError) as error:
            response.success, response.message = False, str(error)
        return response

    def _on_load(self, request, response):
        try:
            response.model_id, response.success = self._learner.load(request.path), True
            self._publish_markers()
        except (ValueError, OSError) as error:
            response.success, response.message = False, str(error)
        return response

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
