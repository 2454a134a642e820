"""The commands of lcmchain by group, and what they share on the terminal."""
