"""The experiments behind the paper's claims, a module each, and what they share."""
