#include <gtest/gtest.h>
#include <ros/ros.h>

/// Every rostest receives its messages on other threads than that of the tests, which wait. rostest gives the
/// node its name.
int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "ros_test");
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
