"""A district of 2 km with a hundred junctions is read as fast as one junction, and in as little memory."""

import subprocess
import sys
from pathlib import Path

from rudc.network.build import find_netconvert

READ = """
import resource, sys, time
from rudc.network.network import load_network
load_network("four_way").route("south", "left")
before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
network = load_network(sys.argv[1], "E5")
network.surface.signed_distance(network.center)
network.route("north", "south")
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(time.process_time() - began, (after - before) / 1e3, len(network.arms))
"""


def test_a_district_of_a_hundred_junctions(tmp_path):
    netgenerate = Path(find_netconvert()).with_name("netgenerate")  # both come with eclipse-sumo
    file = tmp_path / "district.net.xml"
    made = "--grid --grid.number 10 --grid.length 222 --default.lanenumber 2 --default-junction-type priority"
    subprocess.run([netgenerate, *made.split(), "-o", str(file)], check=True, capture_output=True)
    done = subprocess.run([sys.executable, "-c", READ, str(file)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    seconds, grown_mb, arms = map(float, done.stdout.split())
    assert arms == 4
    assert seconds < 2.0
    assert grown_mb < 200.0
