"""Floor 3: barrier functions, ECBF and TTCBF rows, and the QP filter. Knows `Scene`, not SUMO and not torch."""
