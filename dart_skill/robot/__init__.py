"""The WAM: its description, its URDF, the controller's model of it, and the impedance law."""
