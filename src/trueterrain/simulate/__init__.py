"""Virtual profiler: recorded runs over simulated ground whose true heights and motion are known."""
