// Arguments and start values of stereo_refinement.launch, good and bad, and nodelets that go and come back.

#include <gtest/gtest.h>
#include <nodelet/NodeletList.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <nodelet/loader.h>
#include <stereo_msgs/DisparityImage.h>

#include <atomic>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "ChainClient.hpp"
#include "CoreChain.hpp"
#include "DisparityContract.hpp"

namespace disparity_refinement {
namespace {

namespace enc = sensor_msgs::image_encodings;
using rosgraph_msgs::Log;
using sensor_msgs::Image;
using stereo_msgs::DisparityImage;

/// Time that a loaded machine may take to start all nodelets of the launch file [s].
constexpr double START_TIMEOUT = 40.0;

template <class Message>
bool any(const Message& /*message*/) {
  return true;
}

/// A chain in a namespace, with a camera in front of it and listeners behind it.
class Chain {
 public:
  explicit Chain(const std::string& name, const std::string& image = "image_rect")
      : nh("/" + name), camera(nh, StereoCamera::smallStreet(), image), frame(camera.street().render(0)) {}

  /// A pair with the next stamp. No two pairs of the test have the same: a chain that serves two tests may
  /// still hold messages of the first.
  StereoMessages next() {
    static std::atomic<int> index{0};
    return camera.make(frame.left, frame.right, StereoCamera::stamp(index++));
  }

  /// Sends pairs until one has reached all listeners. `prepare` turns them into what the chain expects.
  bool connect(const std::function<void(StereoMessages&)>& prepare = {}) {
    return waitFor(
        [&] {
          StereoMessages messages = next();
          if (prepare) prepare(messages);
          camera.publish(messages);
          return refined.wait(any<DisparityImage>, 0.3) && raw.wait(any<DisparityImage>, 0.0) &&
                 labels.wait(any<Image>, 0.0);
        },
        START_TIMEOUT);
  }

  /// Sends `sent`, and expects what the core gives for `pair`.
  void expectCore(const StereoMessages& pair, const StereoMessages& sent, const CoreParameters& parameters) {
    const CoreResult core = runCore(pair, parameters);
    const ros::Time& stamp = sent.left->header.stamp;
    camera.publish(sent);
    const auto raw_message = raw.wait(stamp);
    const auto labels_message = labels.wait(stamp);
    const auto refined_message = refined.wait(stamp);
    ASSERT_TRUE(raw_message && labels_message && refined_message);
    EXPECT_TRUE(sameBits(imageView(raw_message->image, enc::TYPE_32FC1, "disparity"), core.disparity));
    EXPECT_TRUE(sameBits(imageView(*labels_message, enc::TYPE_32SC1, "labels"), core.labels));
    EXPECT_TRUE(sameBits(imageView(refined_message->image, enc::TYPE_32FC1, "refined"), core.refined));
    expectContract(*refined_message);
    EXPECT_GT(cv::countNonZero(core.refined >= core.range.min), static_cast<int>(core.refined.total()) / 2);
  }

  void expectCore(const CoreParameters& parameters) {
    const StereoMessages pair = next();
    expectCore(pair, pair, parameters);
  }

  ros::NodeHandle nh;
  StereoCamera camera;
  const StreetFrame frame;
  Listener<DisparityImage> raw{nh, "disparity"}, refined{nh, "disparity_refined"};
  Listener<Image> labels{nh, "labels"};
};

/// Those of most chains of launch_arguments.test: what the launch file does unless it is told.
CoreParameters defaultParameters() {
  CoreParameters parameters;
  parameters.matching.disparity_range = 64;
  parameters.matching.full_width = true;
  parameters.matching.aggregate_rows = true;
  parameters.refinement.mode = RefinementMode::QUALITY;
  return parameters;
}

/// Those of the chain "from_file".
CoreParameters fileParameters() {
  CoreParameters parameters;
  parameters.matching.stereo_algorithm = StereoAlgorithm::BM;
  parameters.matching.disparity_range = 64;
  parameters.segmentation.lambda = 20;
  parameters.segmentation.h = 2;
  parameters.refinement.planes.max_divergence = 0.25;
  return parameters;
}

TEST(ParameterFile, isInForceUnlessAnArgumentSaysOtherwise) {
  Chain chain("from_file");
  ASSERT_TRUE(chain.connect());
  chain.expectCore(fileParameters());

  // Each parameter alone changes the result: the bits above say that all are in force.
  const StereoMessages pair = chain.next();
  const CoreResult expected = runCore(pair, fileParameters());
  CoreParameters other = fileParameters();
  other.segmentation.lambda = 80;
  EXPECT_FALSE(sameBits(runCore(pair, other).labels, expected.labels)) << "lambda of the file";
  other.segmentation = SegmentationParameters();
  other.segmentation.lambda = 20;
  EXPECT_FALSE(sameBits(runCore(pair, other).labels, expected.labels)) << "default h";
  other = fileParameters();
  other.refinement = RefinementParameters();
  EXPECT_FALSE(sameBits(runCore(pair, other).refined, expected.refined)) << "default max_divergence";
  other = fileParameters();
  other.matching.disparity_range = MatchingParameters().disparity_range;
  EXPECT_FALSE(sameBits(runCore(pair, other).disparity, expected.disparity)) << "default disparity_range";
  other = fileParameters();
  other.matching.full_width = true;
  EXPECT_FALSE(sameBits(runCore(pair, other).disparity, expected.disparity)) << "full_width of the mode";
  other = fileParameters();
  other.matching.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
  EXPECT_FALSE(sameBits(runCore(pair, other).disparity, expected.disparity)) << "matcher of the file";
}

bool unload(const std::string& manager, const std::string& name) {
  nodelet::NodeletUnload call;
  call.request.name = name;
  return ros::service::call(manager + "/unload_nodelet", call) && call.response.success;
}

/// A nodelet manager in the process of the test.
class OwnManager {
 public:
  explicit OwnManager(const std::string& name) : name_(name), loader_(ros::NodeHandle(name)) {}

  /// Breaks the bonds with the processes of the launch file too: the loader's own destructor would do it when
  /// its nodelets are gone already, and crash.
  ~OwnManager() {
    for (const std::string& nodelet : loader_.listLoadedNodelets()) {
      EXPECT_TRUE(unload(name_, nodelet)) << nodelet;
    }
  }

 private:
  const std::string name_;
  nodelet::Loader loader_;
};

TEST(RefusedStartValue, isReplacedAndReported) {
  Chain chain("refused");
  LogListener log(chain.nh);
  ASSERT_TRUE(waitFor([&log] {
    ROS_WARN("Does the log arrive?");
    return log.waitFor({"Does the log arrive?"}, Log::WARN, 0.1);
  }));
  const OwnManager manager("/listening_manager");
  ASSERT_TRUE(chain.connect());

  const struct {
    std::string name, asked, in_force;
    std::string expected = {};
  } REFUSED[] = {
      {"disparity/stereo_algorithm", "telepathy", "1"},
      {"disparity/correlation_window_size", "8", "9"},
      {"segmentation/lambda", "-7", "0"},
      {"segmentation/h", "deep", "5"},
      {"segmentation/shadow_enhancement", "3", "1"},
      {"segmentation/segmentation_threads", "100", "64", "expected an integer in 1...64:"},
      {"disparity/approximate_sync", "1", "false", "expected true or false:"},
      {"disparity/queue_size", "0", "1", "expected an integer in 1...100000:"},
      {"plane_refinement/cache_size", "many", "30", "expected an integer in 1...100000:"},
      {"plane_refinement/diagnostics_max_age", "soon", "0", "expected a number in 0...1e+06:"},
      {"segmentation/shadow_threshold", "999", "255"},
      {"segmentation/shadow_gamma", "0.001", "0.05", "expected a value in 0.05...1: "},
      {"plane_refinement/refinement_mode", "brilliant", "0", "expected a value in 0...1: "},
      {"plane_refinement/max_divergence", "-1.5", "0"},
      {"plane_refinement/min_valid_fraction", "{0.5}", "0.1"},
  };
  for (const auto& value : REFUSED) {
    const std::string start = "/refused/" + value.name + " is " + value.asked + ", " + value.expected;
    const std::string end = " using " + value.in_force;
    ASSERT_TRUE(log.messages().wait([&](const Log& message) {
      return message.level == Log::WARN && message.msg.compare(0, start.size(), start) == 0 &&
             message.msg.size() > end.size() &&
             message.msg.compare(message.msg.size() - end.size(), end.size(), end) == 0;
    })) << start
        << "..." << end;
  }

  CoreParameters in_force = defaultParameters();
  in_force.matching.correlation_window_size = 9;
  in_force.segmentation.lambda = 0;
  in_force.segmentation.gradient.shadow_threshold = 255;
  in_force.segmentation.gradient.shadow_gamma = 0.05;
  in_force.matching.full_width = false;
  in_force.refinement.mode = RefinementMode::PAPER;
  in_force.refinement.planes.max_divergence = 0.0;
  chain.expectCore(in_force);
  EXPECT_FALSE(log.waitFor({"/refused/disparity/disparity_range is"}, Log::WARN, 0.0)) << "a good value";
}

TEST(Rectification, passesAPairWithoutDistortion) {
  Chain chain("raw_gray", "image_raw");
  ASSERT_TRUE(chain.connect());
  chain.expectCore(defaultParameters());
}

TEST(Rectification, passesAColorPairWithoutDistortion) {
  // image_rect_color is rectified from image_color instead of image_mono.
  Chain chain("raw_color", "image_raw");
  Listener<Image> rectified(chain.nh, "left/image_rect_color");
  const auto toColor = [](StereoMessages& messages) {
    for (auto* image : {&messages.left, &messages.right}) {
      cv::Mat color;
      cv::cvtColor(imageView(**image, enc::MONO8, "gray"), color, cv::COLOR_GRAY2BGR);
      *image = StereoCamera::image((*image)->header, color, enc::BGR8);
    }
  };
  ASSERT_TRUE(chain.connect(toColor));
  const StereoMessages pair = chain.next();
  StereoMessages sent = pair;
  toColor(sent);
  chain.expectCore(pair, sent, defaultParameters());
  const auto message = rectified.wait(pair.left->header.stamp);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->encoding, enc::BGR8);
}

/// The image as a lens with these coefficients shows it.
cv::Mat distort(const cv::Mat& ideal, const sensor_msgs::CameraInfo& info) {
  const cv::Matx33d k(info.K.data());
  std::vector<cv::Point2f> pixels, points;
  for (int y = 0; y < ideal.rows; ++y) {
    for (int x = 0; x < ideal.cols; ++x) pixels.emplace_back(static_cast<float>(x), static_cast<float>(y));
  }
  cv::undistortPoints(pixels, points, k, info.D, cv::noArray(), k);
  cv::Mat distorted;
  cv::remap(ideal, distorted, cv::Mat(points).reshape(2, ideal.rows), cv::noArray(), cv::INTER_LINEAR,
            cv::BORDER_REPLICATE);
  return distorted;
}

TEST(Rectification, removesDistortion) {
  Chain chain("raw_gray", "image_raw");
  Listener<Image> rectified(chain.nh, "left/image_rect");
  const StereoMessages ideal = chain.next();
  const cv::Mat left = imageView(*ideal.left, enc::MONO8, "left");
  const cv::Mat right = imageView(*ideal.right, enc::MONO8, "right");
  const std::vector<double> coefficients = {-0.25, 0.06, 0.0, 0.0, 0.0};
  ideal.left_info->D = ideal.right_info->D = coefficients;
  const cv::Mat distorted_left = distort(left, *ideal.left_info);
  const cv::Mat distorted_right = distort(right, *ideal.right_info);
  const auto toDistorted = [&](StereoMessages& messages) {
    messages = chain.camera.make(distorted_left, distorted_right, messages.left->header.stamp);
    messages.left_info->D = messages.right_info->D = coefficients;
  };
  ASSERT_TRUE(chain.connect(toDistorted));

  StereoMessages sent = chain.next();
  toDistorted(sent);
  chain.camera.publish(sent);
  const auto rectified_message = rectified.wait(sent.left->header.stamp);
  const auto refined_message = chain.refined.wait(sent.left->header.stamp);
  ASSERT_TRUE(rectified_message && refined_message);
  const auto difference = [&left](const cv::Mat& image) {
    return cv::norm(image, left, cv::NORM_L1) / static_cast<double>(left.total());
  };
  const cv::Mat image = imageView(*rectified_message, enc::MONO8, "rectified");
  EXPECT_LT(difference(image), difference(distorted_left) / 2);

  // Almost as many disparities as without distortion are right.
  const auto countRight = [&chain](const cv::Mat& disparity) {
    const cv::Mat error = cv::abs(disparity - chain.frame.disparity);
    return cv::countNonZero((chain.frame.disparity > 0.0F) & (error < 1.0F));
  };
  expectContract(*refined_message);
  const cv::Mat refined = imageView(refined_message->image, enc::TYPE_32FC1, "refined");
  const int ideally_right = countRight(runCore(ideal, defaultParameters()).refined);
  EXPECT_GT(countRight(refined), 0.8 * ideally_right);
  EXPECT_LT(countRight(runCore(sent, defaultParameters()).refined), 0.8 * ideally_right)
      << "the lens distorts nothing: the test says little";
}

/// Somebody listens to an output until the error is in the log: it is logged whenever a listener comes.
template <class Message>
bool failsToSubscribe(ros::NodeHandle& nh, LogListener& log, const std::string& nodelet,
                      const std::string& output) {
  return waitFor(
      [&] {
        const Listener<Message> listener(nh, output);
        return log.waitFor({"[/unreachable/" + nodelet + "] cannot subscribe", "transport 'telepathy'"},
                           Log::ERROR, 2.0);
      },
      START_TIMEOUT);
}

TEST(UnknownTransport, isAnErrorThatSparesTheOtherChains) {
  ros::NodeHandle nh("/unreachable");
  LogListener log(nh);
  ASSERT_TRUE(failsToSubscribe<DisparityImage>(nh, log, "disparity", "disparity"));
  ASSERT_TRUE(failsToSubscribe<Image>(nh, log, "segmentation", "labels"));
  ASSERT_TRUE(failsToSubscribe<Image>(nh, log, "visualization", "segment_borders"));

  nodelet::NodeletList list;
  ASSERT_TRUE(ros::service::call("/manager/list", list));
  for (const char* name : {"/unreachable/segmentation", "/reloaded/segmentation"}) {
    EXPECT_EQ(std::count(list.response.nodelets.begin(), list.response.nodelets.end(), name), 1) << name;
  }
  Chain chain("reloaded");
  ASSERT_TRUE(chain.connect());
  chain.expectCore(defaultParameters());
}

/// Publishes pairs until it is destroyed.
class Driver {
 public:
  explicit Driver(Chain& chain) : chain_(chain), thread_([this] { run(); }) {}

  ~Driver() {
    stop_ = true;
    thread_.join();
  }

 private:
  void run() {
    while (!stop_) {
      chain_.camera.publish(chain_.next());
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  Chain& chain_;
  std::atomic<bool> stop_{false};
  std::thread thread_;  // last: it uses the others
};

TEST(Nodelet, isUnloadedAndLoadedAgainWhileFramesCome) {
  Chain chain("reloaded");
  ASSERT_TRUE(chain.connect());
  {
    const Driver driver(chain);
    const struct {
      std::string name;
      std::function<bool()> isConnected;
    } STAGES[] = {
        {"segmentation", [&chain] { return chain.labels.isConnected(); }},
        {"disparity", [&chain] { return chain.raw.isConnected(); }},
        {"plane_refinement", [&chain] { return chain.refined.isConnected(); }},
    };
    for (const auto& stage : STAGES) {
      const std::string nodelet = "/reloaded/" + stage.name;
      ASSERT_TRUE(unload("/manager", nodelet)) << nodelet;
      EXPECT_TRUE(waitFor([&stage] { return !stage.isConnected(); })) << nodelet;

      nodelet::NodeletLoad load;
      load.request.name = nodelet;
      load.request.type = "disparity_refinement/" + stage.name;
      ASSERT_TRUE(ros::service::call("/manager/load_nodelet", load)) << nodelet;
      ASSERT_TRUE(load.response.success) << nodelet;
      ASSERT_TRUE(waitFor(stage.isConnected)) << nodelet;
      const ros::Time newest = chain.next().left->header.stamp;
      EXPECT_TRUE(chain.refined.wait([&newest](const DisparityImage& message) {
        return message.header.stamp > newest;
      })) << "no frame is refined after "
          << nodelet << " was loaded again";
      for (auto* listener : {&chain.raw, &chain.refined}) listener->clear();
      chain.labels.clear();
    }
  }
  // With the values of the launch arguments still. The listeners connect again after the nodelets have.
  ASSERT_TRUE(chain.connect());
  chain.expectCore(defaultParameters());
}

}  // namespace
}  // namespace disparity_refinement
