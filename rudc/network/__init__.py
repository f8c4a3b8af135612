"""What a .net.xml says and never changes: lanes, movements, paths, routes, right of way, drivable area."""
