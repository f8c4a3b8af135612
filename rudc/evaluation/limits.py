"""What bounds an episode unless somebody says otherwise. Imports nothing: the command line starts with it."""

EPISODE_LIMIT_S = 300.0
"""s of wall time after which an episode is given up"""
