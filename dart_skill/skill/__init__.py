"""The throwing skill: what is observed of a throw, how a skill is learned from throws, and how it improves by practice."""
