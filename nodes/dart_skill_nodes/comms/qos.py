"""Quality of service of the graph's topics, and the clock of its watchdogs."""

from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

LOOP = QoSProfile(depth=10)
"""For subscribers that answer the newest state: reliable, ten messages."""
COMPLETE = QoSProfile(depth=10_000)
"""For what is recorded, at both ends: reliable, 20 s of 500 Hz. A reliable publisher repeats only
what it still keeps, and Fast DDS may take its heartbeat period of 3 s to find out what was lost.
"""
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late joiners get what was published before: demonstrations, marks, fixed transforms. For
subscriptions to NEWEST, too.
"""
NEWEST = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late joiners get the last one alone: what holds until the next message. `ros2 topic echo --once`
prints the first that it gets.
"""
FRAMES = QoSProfile(depth=500)
"""For what comes with every frame of the cameras: reliable, 5 s. Once its history is full, Fast
DDS tells with every message what came before it, so that what was lost is repeated at once.
"""
CALLS = QoSProfile(depth=1000)
"""Services: so many requests may wait, and so many answers of a client that asks with this depth,
too. With ROS's own depth of 10 more are lost, and never answered.
"""
POSES = {
    "reliable": FRAMES,
    "best_effort": QoSProfile(
        depth=5, reliability=ReliabilityPolicy.BEST_EFFORT, history=HistoryPolicy.KEEP_LAST
    ),
}
"""What a motion-capture driver may publish with; the second one is sensor data as ROS has it."""
CLOCK_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""For /clock, as rclpy itself subscribes to it."""

WALL = Clock(clock_type=ClockType.STEADY_TIME)
"""For watchdogs: a machine's time, never the simulation's. No timer comes or goes on it while a
node works (see WAITS).
"""
WAITS = Clock(clock_type=ClockType.STEADY_TIME)
"""The same time for timers that are set again and again. Each time, as with each new timer on a
clock, rclpy's EventsExecutor calls those of that clock again that are due and not yet called; a
repeating one skips a period for each such call, and was silent for up to 25 s (rclpy 7.1.6).
"""
STATUS = Clock(clock_type=ClockType.STEADY_TIME)
"""The same time for the status of nodes, once a second: on the clock of the watchdogs, those that
a node makes while it is configured would silence it for as many seconds.
"""
SYSTEM = Clock(clock_type=ClockType.SYSTEM_TIME)
"""For stamps that do not belong to the time of the world: the date."""
