"""A small deterministic robot simulator: buildings, a robot, its sensors, and logs of what they saw.

Everything happens in the floor frame [m]: origin at the lower left corner of the building's grid, x right, y up.
Only recordings speak of the map frame, into which ``Building.origin`` takes floor coordinates. The same arguments
give the same bytes on the same machine; random numbers come from Philox streams, one for every purpose.

    building     grids, rectangles, landmarks         layouts      office floor, hall, repeated corridors
    changes      boxes moved, doors closed            raycast      exact ranges against grid and people
    planning     A* on a clearance grid               robot        truth, odometry
    sensors      lidar, camera, people walking by     recording    one run, everything measured
    log_writer   ROS 2 MCAP                           files        maps, landmarks, truth
    scenarios    the shipped samples                  reference    the worked example of the documentation
"""
