#include "disparity_refinement/ros/StartParameters.hpp"

#include <ros/console.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace disparity_refinement {
namespace {

using XmlRpc::XmlRpcValue;

template <class Expected, class Value>
void warn(const ros::NodeHandle& private_nh, const std::string& name, const XmlRpcValue& asked,
          const Expected& expected, const Value& in_force) {
  ROS_WARN_STREAM(std::boolalpha << private_nh.resolveName(name) << " is " << asked << ", expected "
                                 << expected << ": using " << in_force);
}

template <class Value>
std::string rangeText(const char* type, Value least, Value largest) {
  std::ostringstream text;
  text << type << " in " << least << "..." << largest;
  return text.str();
}

}  // namespace

int startParameter(const ros::NodeHandle& private_nh, const std::string& name, int fallback, int least,
                   int largest) {
  XmlRpcValue asked;
  if (!private_nh.getParam(name, asked)) return fallback;
  const bool is_number = asked.getType() == XmlRpcValue::TypeInt;
  const int value = is_number ? static_cast<int>(asked) : fallback;
  const int in_force = std::clamp(value, least, largest);
  if (!is_number || in_force != value) {
    warn(private_nh, name, asked, rangeText("an integer", least, largest), in_force);
  }
  return in_force;
}

double startParameter(const ros::NodeHandle& private_nh, const std::string& name, double fallback,
                      double least, double largest) {
  XmlRpcValue asked;
  if (!private_nh.getParam(name, asked)) return fallback;
  double value = std::numeric_limits<double>::quiet_NaN();
  if (asked.getType() == XmlRpcValue::TypeInt) value = static_cast<int>(asked);
  if (asked.getType() == XmlRpcValue::TypeDouble) value = static_cast<double>(asked);
  const double in_force = std::isnan(value) ? fallback : std::clamp(value, least, largest);
  if (in_force != value) warn(private_nh, name, asked, rangeText("a number", least, largest), in_force);
  return in_force;
}

bool startParameter(const ros::NodeHandle& private_nh, const std::string& name, bool fallback) {
  XmlRpcValue asked;
  if (!private_nh.getParam(name, asked)) return fallback;
  if (asked.getType() == XmlRpcValue::TypeBoolean) return static_cast<bool>(asked);
  warn(private_nh, name, asked, "true or false", fallback);
  return fallback;
}

std::size_t startFrames(const ros::NodeHandle& private_nh, const std::string& name, int fallback, int least) {
  constexpr int MOST = 100000;
  return static_cast<std::size_t>(startParameter(private_nh, name, fallback, least, MOST));
}

}  // namespace disparity_refinement
