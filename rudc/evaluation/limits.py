"""What bounds an episode unless somebody says otherwise. Imports nothing: the command line starts with it."""

EPISODE_LIMIT_S = 300.0
"""s of wall time after which an episode is given up"""
LONGEST_LIMIT_S = 1e8
"""s, three years: the most that the timers of every system take"""
