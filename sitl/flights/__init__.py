"""One flight: scenario, launch of its processes, progress. What it leaves is `sitl.report`'s."""
