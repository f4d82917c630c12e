"""The world that stands in for hardware: the arm, its hand, the ball, the basket, the cameras and the teacher."""
