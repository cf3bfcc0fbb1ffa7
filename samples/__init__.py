"""Sample logs and the simulator that makes them; not part of the installed package."""
