"""Studies of what a result depends on: measures that compare forming results."""
