"""Floor 5: roll-out of one episode to a record, metrics, statistics, sweeps and tables."""
