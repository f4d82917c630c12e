"""The ROS 2 nodes of dart_skill, one module each; installed as the import package
`dart_skill_nodes`.
"""
