"""Skills: the machinery that all share, and a folder for each that comes with dart_skill."""
