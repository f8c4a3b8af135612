"""Roll-out of one episode to a record, metrics, statistics, sweeps and tables."""
