"""Results made readable: figures, tables as text, replays of episodes, reports of folders, the gallery."""
