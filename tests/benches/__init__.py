"""Long trials of the real graph, as commands of a checkout: `dart-skill experiment faults`,
`dart-skill experiment soak`.
"""
