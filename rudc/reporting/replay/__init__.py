"""The replay page: one file that shows episodes in a browser, without a network."""
