"""Training: replay, collection from parallel worlds, trainer, logging."""
