#pragma once

#include <dynamic_reconfigure/server.h>
#include <ros/ros.h>

#include <boost/thread/recursive_mutex.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "disparity_refinement/DisparityConfig.h"
#include "disparity_refinement/PlaneRefinementConfig.h"
#include "disparity_refinement/SegmentationConfig.h"
#include "disparity_refinement/VisualizationConfig.h"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {

/// Parameters of the core from a configuration. A value that no single bound of the .cfg can exclude (an even
/// window) is replaced in the configuration too, so that the user sees what is in force.
MatchingParameters toParameters(DisparityConfig& config);
SegmentationParameters toParameters(SegmentationConfig& config);
RefinementParameters toParameters(PlaneRefinementConfig& config);
VisualizationConfig toParameters(VisualizationConfig& config);

/// NaN passes every clamp: it becomes the default value.
template <class Config>
void replaceNan(Config& config) {
  dynamic_reconfigure::Config values, defaults;
  config.__toMessage__(values);
  Config::__getDefault__().__toMessage__(defaults);
  for (std::size_t i = 0; i < values.doubles.size(); ++i) {
    if (std::isnan(values.doubles[i].value)) values.doubles[i].value = defaults.doubles[i].value;
  }
  config.__fromMessage__(values);
}

/// Warns about every start value on the parameter server that is not the one in force: out of the range from
/// `least` to `largest`, or of another type.
void warnAboutRefusedValues(const ros::NodeHandle& private_nh, const dynamic_reconfigure::Config& in_force,
                            const dynamic_reconfigure::Config& least,
                            const dynamic_reconfigure::Config& largest);

/// Waits until nobody offers this service, for two seconds at most. A nodelet that is unloaded in the middle
/// of a callback lives on until that ends, beside the one that is loaded in its place, which could not offer
/// it.
void waitUntilGone(const std::string& service);

/// The parameters of one nodelet, live through dynamic_reconfigure on its private handle. A frame takes one
/// snapshot.
template <class Config>
class LiveParameters {
 public:
  /// One set of values, in both forms.
  struct Snapshot {
    decltype(toParameters(std::declval<Config&>())) parameters;
    dynamic_reconfigure::Config message;  ///< Without groups.
  };

  /// @param changed  Called after every change, by the thread of `private_nh`'s callbacks.
  explicit LiveParameters(
      const ros::NodeHandle& private_nh, std::function<void()> changed = [] {})
      : changed_(std::move(changed)) {
    Config start = Config::__getDefault__();
    start.__fromServer__(private_nh);
    start.__clamp__();
    replaceNan(start);
    toParameters(start);
    dynamic_reconfigure::Config in_force, least, largest;
    start.__toMessage__(in_force);
    Config::__getMin__().__toMessage__(least);
    Config::__getMax__().__toMessage__(largest);
    warnAboutRefusedValues(private_nh, in_force, least, largest);

    waitUntilGone(private_nh.resolveName("set_parameters"));
    server_.reset(new dynamic_reconfigure::Server<Config>(server_mutex_, private_nh));
    // Calls back at once.
    server_->setCallback([this](Config& config, std::uint32_t) {
      replaceNan(config);
      const auto snapshot = std::make_shared<Snapshot>();
      snapshot->parameters = toParameters(config);
      config.__toMessage__(snapshot->message);
      snapshot->message.groups.clear();
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        snapshot_ = snapshot;
      }
      changed_();
    });
  }

  /// Never null; it does not change any more. After every change there is another one: then a stage lets go
  /// of the buffers of its core object, for those of other parameters may be much larger.
  std::shared_ptr<const Snapshot> snapshot() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return snapshot_;
  }

 private:
  const std::function<void()> changed_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Snapshot> snapshot_;
  boost::recursive_mutex server_mutex_;
  std::unique_ptr<dynamic_reconfigure::Server<Config>> server_;
};

}  // namespace disparity_refinement
