"""Floor 9: the commands; no logic of their own."""
