"""The skill learner: hears demonstrations, or reads them from a bag, learns DS-GMR, and plans throws on request."""

from dataclasses import replace
from itertools import cycle

import numpy as np
from dart_skill_msgs.msg import Demonstration, DemonstrationMark, DemonstrationStatus
from dart_skill_msgs.srv import AddTrial, DropDemonstration, Learn, ListDemonstrations, ModelFile, PlanThrow
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.recording import MARK_TOPIC, BagError, Marks, check_known, read_demonstrations, read_dropped
from dart_skill.recording import Demonstration as Shown
from dart_skill.robot import load_registration
from dart_skill.skill.improve import PracticeSettings, PractisingSkill
from dart_skill.skill.learn import SkillConfiguration, Unreachable, component_ellipsoids, configuration, load_model, prepare, save_model
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LATCHED, SYSTEM
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import OK, WARN, Diagnostics, Parameter, declare, run

TABLE = [
    Parameter("frame_id", "frame of demonstrations and plans"),
    Parameter("configuration", "name of the skill's configuration"),
    Parameter("practice_method", "how to learn from own throws: residual, bootstrap, both or none"),
    Parameter("practice_capacity", "demonstrations and trials that are remembered, 0: all", 0, 100_000),
    Parameter("practice_forget", "which trial goes when the memory is full: oldest or crowded"),
    Parameter("registration_file", "cameras and arm as `dart-skill check arm --write` measured them; empty: told from the throws alone"),
]

COLOURS = (ColorRGBA(g=0.62, b=0.45, a=0.5), ColorRGBA(r=0.34, g=0.71, b=0.91, a=0.4), ColorRGBA(r=0.8, g=0.47, b=0.65, a=0.4))
"""Of the product of the frames, and of the frames (Okabe and Ito)."""


class SkillLearner(GuardedNode):
    """Services ~/learn, ~/plan_throw, ~/add_trial, ~/save, ~/load, ~/demonstrations, ~/drop_demonstration; Gaussians on ~/model."""

    def __init__(self):
        super().__init__("skill_learner")
        self.p = declare(self, "skill_learner.yaml", TABLE)
        self._heard: dict[str, Shown] = {}
        self._marked = Marks()
        self._skill: PractisingSkill | None = None
        self._registration = load_registration(self.p["registration_file"]) if self.p["registration_file"] else None
        self._memory = PracticeSettings(self.p["practice_capacity"], self.p["practice_forget"])
        self.create_subscription(Demonstration, "/demonstrations", self._on_demonstration, LATCHED)
        self.create_subscription(DemonstrationMark, MARK_TOPIC, self._on_mark, LATCHED)
        self._marks = self.create_publisher(DemonstrationMark, MARK_TOPIC, LATCHED)
        self._markers = self.create_publisher(MarkerArray, "~/model", LATCHED)
        self.create_service(Learn, "~/learn", self._on_learn)
        self.create_service(ListDemonstrations, "~/demonstrations", self._on_list)
        self.create_service(DropDemonstration, "~/drop_demonstration", self._on_drop)
        self.create_service(PlanThrow, "~/plan_throw", self._on_plan)
        self.create_service(AddTrial, "~/add_trial", self._on_add_trial)
        self.create_service(ModelFile, "~/save", self._on_save)
        self.create_service(ModelFile, "~/load", self._on_load)
        self._diagnostics = Diagnostics(self, self._describe)

    def _on_demonstration(self, message: Demonstration) -> None:
        try:
            one = self._checked(message)
        except ValueError as error:
            self.get_logger().error(f"a demonstration is left out: {error}")
            return
        self._heard[one.id] = one

    def _on_mark(self, mark: DemonstrationMark) -> None:
        self._marked.take(mark)

    def _checked(self, message: Demonstration) -> Shown:
        if message.header.frame_id != self.p["frame_id"]:
            raise ValueError(f"{message.id} is in frame '{message.header.frame_id}', not '{self.p['frame_id']}'")
        return conversions.demonstration(message)

    # services

    def _on_learn(self, request, response):
        try:
            response.pending = not request.bag and len(self._heard) < request.at_least
            if response.pending:
                response.message = f"{len(self._heard)} of {request.at_least} demonstrations have been heard so far"
                return response
            chosen = configuration(request.configuration or self.p["configuration"])
            chosen = chosen if self._registration is None else replace(chosen, registration=self._registration)
            dropped = self._learn_from(request.bag, request.without, chosen)
        except (ValueError, BagError, OSError) as error:
            response.success, response.message = False, str(error)
            self.get_logger().error(f"nothing learned: {error}")
            return response
        skill, practice = self._skill.skill, self._skill.practice
        response.success, response.demonstrations, response.model_id = True, len(practice.demonstrations), skill.model_id
        said = [
            f"learned from {response.demonstrations} demonstrations with '{skill.configuration.name}'",
            f"the hand opens {1e3 * skill.hand_delay:.0f} ms after it is told to",
            *(f"left out: {reason}" for reason in practice.kept_out.values()),
            *([f"dropped: {', '.join(dropped)}"] if dropped else []),
        ]
        response.message = "; ".join(said)
        for reason in practice.kept_out.values():
            self.get_logger().warning(f"left out: {reason}")
        return response

    def _learn_from(self, bag: str, without: list[str], chosen: SkillConfiguration) -> list[str]:
        """Learn from a bag, or from what was heard, but for what was dropped; the ids of that."""
        heard = read_demonstrations(bag) if bag else self._in_order()
        check_known(without, [one.id for one in heard], bag or "the learner")
        marked = read_dropped(bag) if bag else self._marked.dropped
        out = marked | set(without)
        self._take([one for one in heard if one.id not in out], chosen)
        return [one.id for one in heard if one.id in out]

    def _in_order(self) -> list[Shown]:
        """What was heard, as it came."""
        return list(self._heard.values())

    def _on_list(self, request, response):
        try:
            chosen = configuration(request.configuration or self.p["configuration"])
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        response.demonstrations = [self._status(one, chosen) for one in self._in_order()]
        dropped = sum(one.dropped for one in response.demonstrations)
        response.success, response.message = True, f"{len(self._heard)} demonstrations, {dropped} of them dropped"
        return response

    def _status(self, one: Shown, chosen: SkillConfiguration) -> DemonstrationStatus:
        status = DemonstrationStatus(id=one.id, target=conversions.point(one.target), dropped=one.id in self._marked.dropped)
        status.header.frame_id = one.frame_id
        conversions.set_stamp(status.header.stamp, one.stamp_ns)
        status.duration = conversions.duration_msg(float(np.nan_to_num(one.motion_stop - one.motion_start)))
        try:
            status.readable, status.finding = True, prepare(one, chosen).in_words
        except ValueError as error:
            status.finding = str(error)
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
        response.success, response.message = True, f"{request.id} {what}: learn again (dart-skill learn)"
        return response

    def _take(self, demonstrations: list, chosen, practised=None) -> None:
        skill = PractisingSkill(demonstrations, chosen, self.p["practice_method"], self._memory)
        if practised is not None and skill.correction is not None:
            skill.correction.remember(practised)
        self._skill = skill
        self._publish_markers()

    def _on_plan(self, request, response):
        try:
            if request.header.frame_id != self.p["frame_id"]:
                raise ValueError(f"the target is in frame '{request.header.frame_id}', not '{self.p['frame_id']}'")
            if self._skill is None:
                raise ValueError("nothing is learned yet: call ~/learn, or ~/load a model")
            plan = self._skill.plan(conversions.place(request.target, "the target"))
            response.success, response.plan = True, conversions.plan_msg(plan, self.p["frame_id"])
            response.seat = conversions.point(self._skill.skill.seat)
        except ValueError as error:
            response.success, response.unreachable, response.message = False, isinstance(error, Unreachable), str(error)
        return response

    def _on_add_trial(self, request, response):
        response.left = [float("nan")] * 2
        try:
            if self._skill is None:
                raise ValueError("nothing is learned yet: call ~/learn, or ~/load a model, before trials are added")
            planned = request.plan.trajectory.points
            told = self._skill.tell(conversions.plan(request.plan) if planned else None, self._checked(request.trial))
            forgotten = f"forgotten: {', '.join(told.forgotten)}" if told.forgotten else ""
            response.success, response.message, response.left = told.kept, told.reason or forgotten, list(told.left)
            response.demonstrations = len(self._skill.practice.demonstrations)
            self._publish_markers()
        except ValueError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_save(self, request, response):
        try:
            if self._skill is None:
                raise ValueError("nothing is learned yet: there is no model to save")
            skill = self._skill
            practised = [] if skill.correction is None else [skill.correction.throws]
            save_model(request.path, skill.practice.demonstrations, skill.skill.configuration, *practised)
            response.success, response.model_id = True, skill.skill.model_id
        except (ValueError, OSError) as error:
            response.success, response.message = False, str(error)
        return response

    def _on_load(self, request, response):
        try:
            self._take(*load_model(request.path))
            response.success, response.model_id = True, self._skill.skill.model_id
        except (ValueError, OSError) as error:
            response.success, response.message = False, str(error)
        return response

    # what is shown

    def _publish_markers(self) -> None:
        skill = self._skill.skill
        centre = np.median([throw.task for throw in skill.throws], axis=0)
        array = MarkerArray(markers=[Marker(action=Marker.DELETEALL)])
        frames = skill.frame_mixtures(centre)
        groups = {"components": skill.mixture(centre), **{f"frame_{k}": one for k, one in enumerate(frames, start=1) if len(frames) > 1}}
        for colour, (name, mixture) in zip(cycle(COLOURS), groups.items(), strict=False):
            for k, (position, orientation, size) in enumerate(component_ellipsoids(mixture)):
                marker = Marker(ns=name, id=k, type=Marker.SPHERE, action=Marker.ADD, color=colour)
                marker.header.frame_id = self.p["frame_id"]
                conversions.set_pose(marker.pose, position, orientation)
                conversions.set_vector(marker.scale, size)
                array.markers.append(marker)
        targets = Marker(ns="targets", id=0, type=Marker.SPHERE_LIST, action=Marker.ADD)
        targets.header.frame_id = self.p["frame_id"]
        targets.scale.x = targets.scale.y = targets.scale.z = 0.05
        targets.color = ColorRGBA(r=0.8, g=0.3, b=0.1, a=1.0)
        targets.points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in (t.task for t in skill.throws)]
        array.markers.append(targets)
        self._markers.publish(array)

    def _describe(self):
        if self._skill is None:
            return WARN, "nothing learned yet", {"heard": len(self._heard)}
        practice, correction = self._skill.practice, self._skill.correction
        values = {"heard": len(self._heard), "learned_from": len(practice.demonstrations), "kept_out": len(practice.kept_out)}
        values["practised"] = 0 if correction is None else len(correction)
        return OK, "ready to plan", {**values, "model_id": self._skill.skill.model_id, "posture_id": self._skill.skill.posture_id}


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill skill_learner`."""
    run(lambda: [SkillLearner()], args)


if __name__ == "__main__":
    main()
