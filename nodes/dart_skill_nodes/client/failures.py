"""What goes wrong between a client and the graph. No ROS is imported here, so that verbs can name
these without it.
"""


class GraphFailure(RuntimeError):
    """The graph did not do its job: a node died, is missing, or did not answer."""


class CallFailed(GraphFailure):
    """A node that is needed did not answer, or said no."""
