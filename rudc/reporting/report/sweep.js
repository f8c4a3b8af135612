// The report of a sweep.

beginTables();
beginComparisons();
beginEpisodes();
drawAll();
keepFresh();
