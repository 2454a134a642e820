"""Effects that a scene may or may not need, one file each."""
