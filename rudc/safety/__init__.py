"""Barrier functions, ECBF and TTCBF rows, the QP filter. Knows `Scene`, neither SUMO nor torch."""
