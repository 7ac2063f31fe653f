"""A run's bag through ROS's Python tools: read_bag.py BAG RUN. Exits with 1 on the first difference."""

import contextlib
import io
import sys

import rosbag
from rosbag import rosbag_main


def stamps(path):
    """First column of a run's text file, in nanoseconds."""
    found = []
    for line in open(path, encoding="ascii"):
        if not line.startswith("#"):
            seconds, _, rest = line.replace(",", " ").split()[0].partition(".")
            found.append(int(seconds) * 10**9 + int(rest) if rest else int(seconds))
    return sorted(found)  # keyframes stand in the order in which they left the window


def main():
    bag_file, run = sys.argv[1:]
    expected = {
        "/swiftlet/odometry": ("nav_msgs/Odometry", "states.csv", "odom"),
        "/swiftlet/pose": ("geometry_msgs/PoseStamped", "odometry.tum", "odom"),
        "/swiftlet/imu_rate": ("geometry_msgs/PoseStamped", "imu_rate.tum", "odom"),
        "/swiftlet/bias_gyro": ("geometry_msgs/Vector3Stamped", "states.csv", "base_link"),
    }
    with rosbag.Bag(bag_file) as bag:
        info = bag.get_type_and_topic_info().topics
        for topic, (kind, name, frame) in expected.items():
            assert info[topic].msg_type == kind, topic
            read = []
            for _, message, time in bag.read_messages(topics=[topic]):
                assert message.header.stamp == time, topic
                assert message.header.frame_id == frame, topic
                read.append(time.to_nsec())
            assert read == stamps(f"{run}/{name}"), topic
        for _, message, time in bag.read_messages(topics=["/tf"]):
            assert [t.header.stamp for t in message.transforms] == [time] * len(message.transforms)
        kinds = {topic: info[topic].msg_type for topic in info}
        assert kinds["/tf_static"] == "tf2_msgs/TFMessage"
        assert kinds["/swiftlet/frame_mesh"] == "visualization_msgs/Marker"
        assert kinds["/diagnostics"] == "diagnostic_msgs/DiagnosticArray"
        total = sum(topic.message_count for topic in info.values())
        assert total == sum(1 for _ in bag.read_messages()) == bag.get_message_count()
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        rosbag_main.info_cmd([bag_file])
    assert "/swiftlet/odometry" in text.getvalue() and f"{total}" in text.getvalue(), text.getvalue()


main()
