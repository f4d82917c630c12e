"""The skills that come with dart_skill, one module each. `dart_skill.skill.protocol` says what a skill is."""
