"""Results made readable: tables as text, figures."""
