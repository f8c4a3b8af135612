"""`rudc search`: what fails, and how often, over the distributions that a scenario declares."""
