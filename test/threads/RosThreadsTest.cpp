#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>

#include <atomic>
#include <boost/make_shared.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "disparity_refinement/ros/FlowControl.hpp"
#include "disparity_refinement/ros/FrameGate.hpp"
#include "disparity_refinement/ros/FrameWorker.hpp"
#include "disparity_refinement/ros/LiveParameters.hpp"
#include "disparity_refinement/ros/OptionalJoin.hpp"
#include "disparity_refinement/ros/StageMonitor.hpp"
#include "disparity_refinement/ros/StampCache.hpp"

// What several threads share in the nodelets: for ThreadSanitizer.

namespace disparity_refinement {
namespace {

/// Runs a piece of work in several threads at the same time: work(0), work(1), ...
template <typename Work>
void runThreads(int threads, const Work& work) {
  std::vector<std::thread> running;
  for (int i = 0; i < threads; ++i) running.emplace_back([&work, i] { work(i); });
  for (std::thread& thread : running) thread.join();
}

int valueOf(const dynamic_reconfigure::Config& message, const std::string& name) {
  for (const dynamic_reconfigure::IntParameter& parameter : message.ints) {
    if (parameter.name == name) return parameter.value;
  }
  throw std::runtime_error("no parameter " + name);
}

void setSegmentation(int lambda, int h) {
  dynamic_reconfigure::Reconfigure change;
  change.request.config.ints.resize(2);
  change.request.config.ints[0].name = "lambda";
  change.request.config.ints[0].value = lambda;
  change.request.config.ints[1].name = "h";
  change.request.config.ints[1].value = h;
  ASSERT_TRUE(ros::service::call(ros::names::resolve("~live/set_parameters"), change));
}

TEST(RosThreads, takeParametersThatBelongTogether) {
  constexpr int CHANGES = 60;
  std::atomic<int> changes{0};
  const LiveParameters<SegmentationConfig> live(ros::NodeHandle("~live"), [&changes] { ++changes; });
  setSegmentation(0, 0);
  std::atomic<bool> is_done{false};
  std::atomic<int> mixtures{0}, falls{0};
  runThreads(3, [&](int i) {
    if (i == 0) {
      for (int h = 1; h <= CHANGES; ++h) setSegmentation(100 * h, h);
      is_done = true;
      return;
    }
    for (int last = 0; !is_done;) {
      const auto snapshot = live.snapshot();
      const SegmentationParameters& parameters = snapshot->parameters;
      const bool is_whole = parameters.lambda == 100 * parameters.h &&
                            valueOf(snapshot->message, "lambda") == parameters.lambda &&
                            valueOf(snapshot->message, "h") == parameters.h;
      if (!is_whole) ++mixtures;
      if (parameters.h < last) ++falls;
      last = parameters.h;
      std::this_thread::yield();
    }
  });
  EXPECT_EQ(mixtures, 0);
  EXPECT_EQ(falls, 0);
  EXPECT_EQ(live.snapshot()->parameters.h, CHANGES);
  EXPECT_GE(changes, CHANGES) << "and one at the start";
}

TEST(RosThreads, workOnFramesWhileTheyAreCounted) {
  std::atomic<int> pushed{0}, processed{0}, reports{0};
  StageMonitor monitor("threads", ros::NodeHandle("~worker"), ros::NodeHandle("~worker"));
  monitor.addDiagnostics([&](diagnostic_updater::DiagnosticStatusWrapper& status) {
    status.add("processed", processed.load());
    ++reports;
  });
  monitor.start();
  {
    int last = -1;  // Plain memory that only the worker's thread may touch.
    FrameWorker<int> worker(3, monitor, [&](const int& frame) {
      last = frame;
      ++processed;
      monitor.traceReceived("topic", ros::Time(1), &last);
      monitor.published(ros::Time::now(), 1.0);
      if (frame % 100 == 99) throw std::runtime_error("frame " + std::to_string(frame % 1000));
    });
    // Until there were reports, which come once a second; for a minute at most.
    runThreads(2, [&](int i) {
      for (int k = 0; k < 60000 && reports < 3; ++k) {
        worker.push(pushed++);
        if (k % 50 == 0) monitor.warning("producer " + std::to_string(i));
        monitor.setActive(k % 2 == 0);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
  }
  monitor.stop();
  EXPECT_GE(reports, 3);
  EXPECT_GT(processed, 0);
  EXPECT_LE(processed, pushed);
}

constexpr int FRAMES = 500;

TEST(RosThreads, matchAFrameWhenTheOneBeforeIsRefined) {
  FlowControl flow(1, 2);
  StageMonitor monitor("threads", ros::NodeHandle("~flow"), ros::NodeHandle("~flow"));
  std::atomic<int> matched{0};
  int refined = 0;
  {
    FrameWorker<int> worker(
        FRAMES, monitor,
        [&](const int& frame) {
          flow.matched(ros::Time(frame, 0), 1e-4, ros::SteadyTime::now());
          matched = frame;
        },
        [&] { return flow.delay(ros::SteadyTime::now()); });
    runThreads(2, [&](int i) {
      for (int frame = 1; i == 0 && frame <= FRAMES; ++frame) worker.push(frame);
      while (i == 1 && refined < FRAMES) {
        if (const int frame = matched; frame > refined) {
          refined = frame;
          flow.refined(ros::Time(frame, 0), ros::SteadyTime::now());
          worker.wake();
        }
        std::this_thread::yield();
      }
    });
  }
  EXPECT_EQ(matched, FRAMES);
}

sensor_msgs::ImagePtr imageOf(int frame) {
  const auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = ros::Time(static_cast<std::uint32_t>(frame) + 1, 0);
  return image;
}

TEST(RosThreads, letEveryFramePassOnceOrDropIt) {
  std::map<ros::Time, int> passed;  // Only touched while the gate is locked.
  int dropped = 0;
  FrameGate<sensor_msgs::Image> gate(
      10, ros::WallDuration(0.001),
      [&](const sensor_msgs::ImageConstPtr& frame) { ++passed[frame->header.stamp]; },
      [&](int frames) { dropped += frames; });
  std::atomic<bool> is_done{false};
  runThreads(3, [&](int i) {
    for (int frame = 0; i < 2 && frame < FRAMES; ++frame) {
      if (i == 0) gate.addFrame(imageOf(frame));
      if (i == 1) gate.announce(imageOf(frame)->header.stamp);
    }
    if (i == 0) is_done = true;
    while (i == 2 && !is_done) {
      gate.expire();
      std::this_thread::yield();
    }
  });
  // What has waited longer than the patience passes.
  std::this_thread::sleep_for(std::chrono::milliseconds(10));
  gate.expire();
  EXPECT_EQ(static_cast<int>(passed.size()) + dropped, FRAMES);
  for (const auto& [stamp, times] : passed) EXPECT_EQ(times, 1) << stamp;
}

TEST(RosThreads, findWhatWasKept) {
  StampCache<sensor_msgs::Image> cache(FRAMES);
  std::atomic<bool> is_done{false};
  std::atomic<int> wrong{0};
  runThreads(3, [&](int i) {
    if (i == 0) {
      for (int frame = 0; frame < FRAMES; ++frame) cache.add(imageOf(frame));
      is_done = true;
      return;
    }
    // The next one, until it comes.
    for (int frame = 0; frame < FRAMES && !is_done;) {
      const ros::Time stamp = imageOf(frame)->header.stamp;
      const sensor_msgs::ImageConstPtr found = cache.find(stamp);
      if (found && found->header.stamp != stamp) ++wrong;
      if (found) ++frame;
    }
  });
  EXPECT_EQ(wrong, 0);
  for (int frame = 0; frame < FRAMES; ++frame) {
    EXPECT_TRUE(cache.find(imageOf(frame)->header.stamp)) << "frame " << frame;
  }
}

TEST(RosThreads, joinEveryFrameOnce) {
  std::map<int, int> emitted;  // Only touched while the join is locked.
  int with_message = 0;
  OptionalJoin<int, sensor_msgs::Image> join(
      10, [&](const int& frame, const sensor_msgs::ImageConstPtr& message) {
        ++emitted[frame];
        with_message += message ? 1 : 0;
      });
  std::atomic<bool> is_done{false};
  runThreads(4, [&](int i) {
    if (i == 0) {
      for (int frame = 0; frame < FRAMES; ++frame) join.addFrame(imageOf(frame)->header.stamp, frame);
      is_done = true;
    } else if (i == 1) {
      for (int frame = 0; frame < FRAMES; ++frame) join.addMessage(imageOf(frame));
    } else {
      while (!is_done) {
        if (i == 2) join.expire(ros::WallDuration(-1.0));
        if (i == 3) join.flush();
        std::this_thread::yield();
      }
    }
  });
  join.flush();
  ASSERT_EQ(static_cast<int>(emitted.size()), FRAMES);
  for (const auto& [frame, times] : emitted) EXPECT_EQ(times, 1) << "frame " << frame;
  EXPECT_LE(with_message, FRAMES);
}

}  // namespace
}  // namespace disparity_refinement
