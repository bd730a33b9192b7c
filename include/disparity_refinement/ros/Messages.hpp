#pragma once

#include <cv_bridge/cv_bridge.h>
#include <dynamic_reconfigure/Config.h>
#include <ros/publisher.h>
#include <sensor_msgs/Image.h>
#include <stereo_msgs/DisparityImage.h>

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "disparity_refinement/DisparityRange.hpp"
#include "disparity_refinement/FrameParameters.h"
#include "disparity_refinement/Planes.h"
#include "disparity_refinement/refinement/PlaneRefinement.hpp"
#include "disparity_refinement/ros/StereoGeometry.hpp"

/// Messages seen as core types. Nothing is copied but images that are not mono8.
/// Every error is a std::invalid_argument that names the topic.
namespace disparity_refinement {

/// Throws if the stamp is no time of exposure: 0, which ROS takes for unknown, or so late that ros::Duration
/// cannot span the time until then.
void requireTime(const std_msgs::Header& header, const std::string& topic);

/// The image as CV_8UC1: mono8 and 8UC1 share the message's memory, any other colour, Bayer or 16-bit
/// encoding is converted.
cv_bridge::CvImageConstPtr grayImage(const sensor_msgs::ImageConstPtr& message, const std::string& topic);

/// A new image with its memory reserved.
sensor_msgs::ImagePtr makeImage(const std_msgs::Header& header, const cv::Size& size,
                                const std::string& encoding);

/// The memory of a message as a matrix; checks encoding, step, amount of data and byte order. A map read from
/// a ConstPtr must not be written.
cv::Mat imageView(const sensor_msgs::Image& message, const std::string& encoding, const std::string& topic);

/// A new DisparityImage with all fields but the disparities.
stereo_msgs::DisparityImagePtr makeDisparityImage(const std_msgs::Header& header, const cv::Size& size,
                                                  const StereoGeometry& geometry, const DisparityRange& range,
                                                  const cv::Rect& valid_window);

/// Range of a DisparityImage of any publisher. Some publish a max_disparity below their largest disparity, or
/// none: it is raised to the next whole number above what the map holds.
DisparityRange disparityRange(const stereo_msgs::DisparityImage& message, const std::string& topic);

/// Focal length and baseline of a DisparityImage; throws if one is not positive.
StereoGeometry disparityGeometry(const stereo_msgs::DisparityImage& message, const std::string& topic);

/// Depth image of REP 118: 32FC1, Z = f * T / d [m], NaN where unknown.
sensor_msgs::ImagePtr depthImage(const std_msgs::Header& header, const cv::Mat& disparity,
                                 const DisparityRange& range, const StereoGeometry& geometry);

/// Publishes the parameters of one frame if anybody listens.
void publishParameters(const ros::Publisher& publisher, const std_msgs::Header& header,
                       const dynamic_reconfigure::Config& parameters);

/// Without parameters.
PlanesPtr planesMessage(const std_msgs::Header& header, const std::vector<SegmentPlane>& planes);

/// The planes of a message; throws if one has a status that Plane.msg does not know.
std::vector<SegmentPlane> segmentPlanes(const Planes& message, const std::string& topic);

}  // namespace disparity_refinement
