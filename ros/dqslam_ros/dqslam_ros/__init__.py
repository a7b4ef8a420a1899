"""A ROS 2 node around ``dqslam.OnlineSlam``; ``session`` has the logic and knows no ROS."""
