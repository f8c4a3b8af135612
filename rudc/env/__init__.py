"""Floor 3: the Gymnasium face: observation, reward terms, termination, rendering."""
