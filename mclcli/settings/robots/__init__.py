"""Files of parameters in any dialect: what the robot's say to mcl, and mcl's settings written for the robot."""
